/* Files: see files.h. */
#include "compat.h"
#include "files.h"
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#define CANNOT_WRITE "Cannot write '%s': %s. Check the disk or choose another -output_dir"

int FileBegin(const char path[], FILE **f)
{
  char partial[PETSC_MAX_PATH_LEN];

  (void)snprintf(partial, sizeof(partial), "%s.part", path);
  *f = fopen(partial, "w");
  return *f ? 0 : errno;
}

int FileClose(FILE **file)
{
  FILE     *f   = *file;
  const int bad = f ? ferror(f) : 0;

  *file = NULL;
  if (f && (fclose(f) || bad)) return errno ? errno : EIO;
  return 0;
}

int FileEnd(const char path[], FILE **f)
{
  char      partial[PETSC_MAX_PATH_LEN];
  const int err = FileClose(f);

  (void)snprintf(partial, sizeof(partial), "%s.part", path);
  if (err) return err;
  return rename(partial, path) ? errno : 0;
}

PetscInt FilesRemoveAfter(const char dir[], PetscInt step)
{
  static const char *const KIND[]   = {"fields_", "mesh_",  "bodies_",  "bonds_",    "drops_", "solid_",
                                       "table_",  "pairs_", "profile_", "contacts_", NULL};
  static const char *const ENDING[] = {".h5", ".csv", ".xdmf", NULL};
  DIR                     *d        = opendir(dir);
  PetscInt                 n        = 0;
  struct dirent           *entry;

  while (d && (entry = readdir(d))) {
    const char *name = entry->d_name;
    char        path[PETSC_MAX_PATH_LEN];
    long        number;
    int         k = 0, e = 0, end = 0;

    while (KIND[k] && strncmp(name, KIND[k], strlen(KIND[k]))) k++;
    if (!KIND[k] || sscanf(name + strlen(KIND[k]), "%ld%n", &number, &end) != 1 || number <= (long)step) continue;
    while (ENDING[e] && strcmp(name + strlen(KIND[k]) + end, ENDING[e])) e++;
    if (!ENDING[e]) continue;
    if (snprintf(path, sizeof(path), "%s/%s", dir, name) < (int)sizeof(path)) n += !remove(path);
  }
  if (d) (void)closedir(d);
  return n;
}

PetscErrorCode FileCheck(MPI_Comm comm, int err, const char path[])
{
  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Bcast(&err, 1, MPI_INT, 0, comm));
  PetscCheck(!err, comm, PETSC_ERR_FILE_WRITE, CANNOT_WRITE, path, strerror(err));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FileCloseHdf5(MPI_Comm comm, const char path[], Hdf5 *file)
{
  char reason[256];

  PetscFunctionBeginUser;
  PetscCall(Hdf5Close(file, reason, sizeof(reason)));
  PetscCheck(!reason[0], comm, PETSC_ERR_FILE_WRITE, CANNOT_WRITE, path, reason);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const char XDMF_OLD[] = ".xmf";

static void name_index(const char dir[], const char kind[], const char ending[], char path[PETSC_MAX_PATH_LEN])
{
  (void)snprintf(path, PETSC_MAX_PATH_LEN, "%s/%s%s", dir, kind, ending);
}

int XdmfExists(const char dir[], const char kind[])
{
  char path[PETSC_MAX_PATH_LEN], old[PETSC_MAX_PATH_LEN];

  name_index(dir, kind, XDMF_ENDING, path);
  name_index(dir, kind, XDMF_OLD, old);
  return !access(path, F_OK) || !access(old, F_OK);
}

void XdmfRemove(const char dir[], const char kind[])
{
  char path[PETSC_MAX_PATH_LEN];

  name_index(dir, kind, XDMF_ENDING, path);
  (void)remove(path);
  name_index(dir, kind, XDMF_OLD, path);
  (void)remove(path);
}

int XdmfBegin(const char path[], const char collection[], FILE **f)
{
  const int err = FileBegin(path, f);

  if (err) return err;
  fprintf(*f, "<?xml version=\"1.0\" ?>\n<!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<Xdmf Version=\"3.0\">\n  <Domain>\n");
  if (collection)
    fprintf(*f, "    <Grid Name=\"%s\" GridType=\"Collection\" CollectionType=\"Temporal\">\n", collection);
  return 0;
}

int XdmfEnd(const char path[], const char collection[], FILE **f)
{
  const size_t stem = strlen(path) - strlen(XDMF_ENDING);
  char         old[PETSC_MAX_PATH_LEN];
  int          err;

  fprintf(*f, "%s  </Domain>\n</Xdmf>\n", collection ? "    </Grid>\n" : "");
  err = FileEnd(path, f);
  if (!err && snprintf(old, sizeof(old), "%.*s%s", (int)stem, path, XDMF_OLD) < (int)sizeof(old)) (void)remove(old);
  return err;
}

void XdmfItem(FILE *f, PetscBool integer, PetscInt n, PetscInt bs, const char file[], const char name[])
{
  const size_t precision = integer ? sizeof(PetscInt) : sizeof(PetscReal);

  fprintf(f, "<DataItem Format=\"HDF\" NumberType=\"%s\" Precision=\"%d\" Dimensions=\"%" PetscInt_FMT,
          integer ? "Int" : "Float", (int)precision, n);
  if (bs > 1) fprintf(f, " %" PetscInt_FMT, bs);
  fprintf(f, "\">%s:/%s</DataItem>", file, name);
}

void XdmfAttribute(FILE *f, PetscBool integer, PetscInt n, PetscInt bs, const char centre[], const char name[],
                   const char file[], const char item[])
{
  fprintf(f, "        <Attribute Name=\"%s\" AttributeType=\"%s\" Center=\"%s\">", name,
          bs == 6  ? "Tensor6"
          : bs > 1 ? "Vector"
                   : "Scalar",
          centre);
  XdmfItem(f, integer, n, bs, file, item);
  fprintf(f, "</Attribute>\n");
}
