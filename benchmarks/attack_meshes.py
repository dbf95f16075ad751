"""Attack the package with mesh files: the command line of `fcdm_opt_benchmarks.attack.mesh_files`."""

import sys

from fcdm_opt_benchmarks.attack.mesh_files import main

if __name__ == "__main__":
    sys.exit(main())
