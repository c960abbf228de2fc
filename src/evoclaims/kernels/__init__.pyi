from evoclaims.kernels.call.by_platform import by_platform as by_platform
from evoclaims.kernels.call.grouped import GroupKernel as GroupKernel
from evoclaims.kernels.call.grouped import gpus_run_kernels as gpus_run_kernels
from evoclaims.kernels.call.kernel import one_kernel as one_kernel
from evoclaims.kernels.call.random_bits import kernel_prng as kernel_prng
from evoclaims.kernels.call.take_rows import take_rows as take_rows
from evoclaims.kernels.trace.in_numpy import in_numpy as in_numpy
from evoclaims.kernels.trace.seldom import seldom as seldom
