"""The package, and with it the data set that lies beside it: questions, and scripts that answer and score them."""

from setuptools import find_packages, setup

DATASET = "fcdm_opt_benchmarks.question_files"
setup(
    packages=[*find_packages(include=["fcdm_opt_benchmarks*"]), DATASET],
    package_dir={DATASET: "dataset"},
    package_data={"fcdm_opt_benchmarks": ["py.typed"], DATASET: ["*.json", "*.md"]},
)
