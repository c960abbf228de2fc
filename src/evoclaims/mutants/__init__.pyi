from evoclaims.mutants.faults import Fault as Fault
from evoclaims.mutants.faults import FaultyTask as FaultyTask
from evoclaims.mutants.faults import plant as plant
from evoclaims.mutants.mutant import Mutant as Mutant
from evoclaims.mutants.mutant import of_method as of_method
from evoclaims.mutants.mutant import of_task as of_task
from evoclaims.mutants.mutant import with_method as with_method
from evoclaims.mutants.mutant import with_task as with_task
