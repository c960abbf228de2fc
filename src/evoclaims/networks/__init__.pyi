from evoclaims.networks.all_skips import AllSkips as AllSkips
from evoclaims.networks.base import Network as Network
from evoclaims.networks.mlp import Mlp as Mlp
from evoclaims.networks.substrate import Substrate as Substrate
from evoclaims.networks.substrate import on_circle as on_circle
