from evoclaims.mutants.mutant import Mutant as Mutant
from evoclaims.mutants.mutant import of_method as of_method
from evoclaims.mutants.mutant import of_task as of_task
from evoclaims.mutants.mutant import with_method as with_method
from evoclaims.mutants.mutant import with_task as with_task
from evoclaims.mutants.of_tasks import FaultyTask as FaultyTask
from evoclaims.mutants.planting import Fault as Fault
from evoclaims.mutants.planting import plant as plant
