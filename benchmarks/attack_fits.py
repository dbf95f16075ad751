"""Attack the package on ordinary parts: the command line of `fcdm_opt_benchmarks.attack.run`."""

import sys

from fcdm_opt_benchmarks.attack.run import main

if __name__ == "__main__":
    sys.exit(main())
