# Spack recipe of tumble; not built yet: no Spack was at hand. Copy to <repo>/packages/tumble/package.py and write the address of the sources into `git`.
from spack.package import *


class Tumble(MakefilePackage):
    """Rigid bodies of any shape in a viscous incompressible fluid, by finite elements on PETSc."""

    homepage = "https://example.org/tumble"
    git = "https://example.org/tumble.git"

    license("BSD-2-Clause")
    version("main", branch="main")

    variant("int64", default=False, description="64-bit numbers, for more than 76 million cells in space")

    depends_on("c", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("mpi")
    depends_on("petsc@3.18:+mpi+hypre+mumps+hdf5+libyaml~complex+double")
    depends_on("petsc+int64", when="+int64")
    depends_on("petsc~int64", when="~int64")
    depends_on("hdf5+mpi")
    depends_on("metis")
    depends_on("libyaml")
    depends_on("muparser")
    depends_on("python@3.9:", type="run")
    depends_on("py-numpy", type="run")
    depends_on("py-matplotlib", type="run")
    depends_on("py-h5py", type="run")

    def build(self, spec, prefix):
        make("SETUP=true", "CC={0}".format(spec["mpi"].mpicc), "PETSC_DIR={0}".format(spec["petsc"].prefix), "PETSC_ARCH=", "OPT=-O3 -fno-math-errno")

    def install(self, spec, prefix):
        make("install", "SETUP=true", "CC={0}".format(spec["mpi"].mpicc), "PETSC_DIR={0}".format(spec["petsc"].prefix), "PETSC_ARCH=",
             "OPT=-O3 -fno-math-errno", "PREFIX={0}".format(prefix))  # fmt: skip
