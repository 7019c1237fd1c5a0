"""The mass-spring lattice of the study: kernels, solvers, sweeps. Import from the modules; importing this package
starts nothing.
"""

from rig.tissue.lattice.compiled import keep_compiled_kernels

keep_compiled_kernels()
