from evoclaims.methods.neat.evolution import Neat as Neat
from evoclaims.methods.neat.settings import Attribute as Attribute
from evoclaims.methods.neat.settings import Mutation as Mutation
from evoclaims.methods.neat.settings import Settings as Settings
from evoclaims.methods.neat.settings import Species as Species
