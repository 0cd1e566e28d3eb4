/* Shapes: finding, loading and checking shape plugins, and the calls every user of a shape makes.

   A plugin is a shared object that exports one constant record, `tumble_shape` (shape.h). It is opened once with
   dlopen, kept in a table until ShapeFinalize, and its record is checked before anything in it is called. Files may be
   missing or broken on one rank only, so the outcome of loading is agreed on: all ranks raise the error of the lowest
   rank that failed. */
#if !defined(_GNU_SOURCE)
  #define _GNU_SOURCE /* dladdr */
#endif
#include "compat.h"
#include "guard.h"
#include "impl.h"
#include "base/opt.h"
#include <dirent.h>
#include <dlfcn.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <unistd.h>

#define MAX_PLUGINS 64
#define MAX_PATHS   4096
/* interfaces whose records end before these operations */
#define BEFORE_CORNERS   1
#define BEFORE_TRIANGLES 2

static Loaded   table[MAX_PLUGINS];
static PetscInt ntable = 0;
static PetscInt nalive = 0; /* shapes not yet destroyed: their code must stay loaded */

/* ---- messages and folders ---- */

/* Lets a loading function describe what went wrong without raising it yet. */
static PetscErrorCode Complain(char message[], size_t len, const char format[], ...)
{
  va_list args;

  PetscFunctionBeginUser;
  va_start(args, format);
  PetscCall(PetscVSNPrintf(message, len, format, NULL, args));
  va_end(args);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* If any rank has a message, all ranks raise that of the lowest such rank. Collective. */
static PetscErrorCode AgreeOnMessage(char message[], size_t len)
{
  PetscMPIInt rank, size, mine, first;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(ShapeComm(), &rank));
  PetscCallMPI(MPI_Comm_size(ShapeComm(), &size));
  mine = message[0] ? rank : size;
  PetscCallMPI(MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, ShapeComm()));
  if (first == size) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Bcast(message, (int)len, MPI_CHAR, first, ShapeComm()));
  SETERRQ(ShapeComm(), PETSC_ERR_USER_INPUT, "%s", message);
}

/* The folder `shapes` beside the library or executable this function is part of, "" if it cannot be found. */
static PetscErrorCode FindOwnFolder(char folder[], size_t len)
{
  Dl_info info;
  char    real[PETSC_MAX_PATH_LEN], *slash;

  PetscFunctionBeginUser;
  folder[0] = 0;
  if (!dladdr((void *)(size_t)&ShapeCreate, &info) || !info.dli_fname || !realpath(info.dli_fname, real))
    PetscFunctionReturn(PETSC_SUCCESS);
  slash = strrchr(real, '/');
  if (slash) *slash = 0;
  PetscCall(PetscSNPrintf(folder, len, "%s/shapes", real));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All folders to search, joined by colons: -shape_path, then the one beside the library. */
static PetscErrorCode GetPath(char path[], size_t len)
{
  char user[MAX_PATHS] = "", own[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(OptString("-shape_path", user, sizeof(user)));
  PetscCall(FindOwnFolder(own, sizeof(own)));
  PetscCall(PetscSNPrintf(path, len, "%s%s%s", user, user[0] ? ":" : "", own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int CompareNames(const void *a, const void *b)
{
  return strcmp(*(char *const *)a, *(char *const *)b);
}

/* Append the names of the plugins in one folder to names[]. A folder that cannot be read holds none. */
static PetscErrorCode ListFolder(const char folder[], PetscInt max, PetscInt *n, char *names[])
{
  DIR           *dir = opendir(folder);
  struct dirent *entry;

  PetscFunctionBeginUser;
  if (!dir) PetscFunctionReturn(PETSC_SUCCESS);
  while ((entry = readdir(dir)) && *n < max) {
    size_t len = strlen(entry->d_name);

    if (len > 3 && !strcmp(entry->d_name + len - 3, ".so")) {
      PetscCall(PetscStrallocpy(entry->d_name, &names[*n]));
      names[(*n)++][len - 3] = 0;
    }
  }
  closedir(dir);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "airfoil, circle, ellipse": every plugin in the search path but the template for new ones, sorted, each once. */
static PetscErrorCode ListKnown(const char path[], char list[], size_t len)
{
  char   **folder, *names[256];
  int      nfolder;
  PetscInt n = 0;

  PetscFunctionBeginUser;
  list[0] = 0;
  PetscCall(PetscStrToArray(path, ':', &nfolder, &folder));
  for (int i = 0; i < nfolder; i++) PetscCall(ListFolder(folder[i], 256, &n, names));
  PetscCall(PetscStrToArrayDestroy(nfolder, folder));
  qsort(names, (size_t)n, sizeof(names[0]), CompareNames);
  for (PetscInt i = 0; i < n; i++) {
    if (!strcmp(names[i], "template") || (i && !strcmp(names[i], names[i - 1]))) continue;
    if (list[0]) PetscCall(PetscStrlcat(list, ", ", len));
    PetscCall(PetscStrlcat(list, names[i], len));
  }
  for (PetscInt i = 0; i < n; i++) PetscCall(PetscFree(names[i]));
  if (!list[0]) PetscCall(PetscStrncpy(list, "none found", len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What others call the shapes, each with ours */
static const char OTHER_NAMES[] =
  "sphere circle (in space it is a sphere), ball circle (in space it is a sphere), disc circle, disk circle, circular circle, round circle, rectangle "
  "box, rect box, square box, cube box, cuboid box, block box, brick box, plate box (or leaflet with round ends), ellipsoid ellipse (in space with "
  "-particle_<group>_c), spheroid ellipse (in space with -particle_<group>_c), oval ellipse, capsule leaflet, rod leaflet, stick leaflet, fibre leaflet, "
  "fiber leaflet, bar box (or leaflet with round ends), spherocylinder leaflet, flap leaflet, naca airfoil, aerofoil airfoil, foil airfoil, wing "
  "airfoil, triangle polygon, outline polygon, points polygon, hexagon polygon, mesh stl, surface stl, triangulation stl, obj stl, donut torus, "
  "doughnut torus, annulus ring, tube ring, union composite, compound composite, multi composite, clump composite, superquadric superellipsoid, "
  "superellipse superellipsoid, pipe cylinder";

/* ---- loading ---- */

/* The first readable folder/type.so of the path; file is "" if there is none. */
static PetscErrorCode FindFile(const char path[], const char type[], char file[], size_t len)
{
  char **folder;
  int    nfolder;

  PetscFunctionBeginUser;
  file[0] = 0;
  PetscCall(PetscStrToArray(path, ':', &nfolder, &folder));
  for (int i = 0; i < nfolder && !file[0]; i++) {
    PetscCall(PetscSNPrintf(file, len, "%s/%s.so", folder[i], type));
    if (access(file, R_OK)) file[0] = 0;
  }
  PetscCall(PetscStrToArrayDestroy(nfolder, folder));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Everything that can be wrong with a record, before any of its functions is called. */
static PetscErrorCode CheckPlugin(const ShapePlugin *p, const char type[], const char file[], char message[],
                                  size_t len)
{
  PetscFunctionBeginUser;
  if (!p) {
    PetscCall(
      Complain(message, len,
               "%s does not register a shape (no symbol 'tumble_shape'): add TUMBLE_SHAPE_REGISTER = {...} at its end, see shapes/template.c",
               file));
  } else if (p->interface != SHAPE_INTERFACE && p->interface != BEFORE_CORNERS && p->interface != BEFORE_TRIANGLES) {
    PetscCall(
      Complain(message, len,
               "%s was built for shape interface %d, this program has %d: rebuild it with this program's shape.h", file,
               p->interface, SHAPE_INTERFACE));
  } else if (!p->type || strcmp(p->type, type)) {
    PetscCall(Complain(message, len, "%s registers the type '%s': rename the file to %s.so or the type to '%s'", file,
                       p->type ? p->type : "", p->type ? p->type : "<type>", type));
  } else if (!p->ops.distance || !p->ops.radius) {
    PetscCall(Complain(message, len,
                       "%s lacks the required operation '%s': set .ops.%s in its record, see shapes/template.c", file,
                       p->ops.distance ? "radius" : "distance", p->ops.distance ? "radius" : "distance"));
  } else if (!(p->dims & 3)) {
    PetscCall(Complain(message, len,
                       "%s works in no dimension (dims = %d): set .dims in its record to 1 (2D), 2 (3D) or 3 (both)",
                       file, p->dims));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Not collective: what goes wrong is left in message for the ranks to agree on. */
static PetscErrorCode OpenPlugin(const char path[], const char type[], Loaded *slot, char message[], size_t len)
{
  char known[2048], advice[128];

  PetscFunctionBeginUser;
  PetscCall(FindFile(path, type, slot->file, sizeof(slot->file)));
  if (!slot->file[0]) {
    PetscCall(ListKnown(path, known, sizeof(known)));
    OptAdviseWord(type, known, OTHER_NAMES, advice, sizeof(advice));
    PetscCall(
      Complain(message, len,
               "Shape '%s' is not known (known: %s)%s Correct the name, or put %s.so into a folder of -shape_path",
               type, known, advice[0] ? advice : ".", type));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  /* stays mapped: PETSc keeps pointers to names of functions in it */
  slot->handle = dlopen(slot->file, RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (!slot->handle) {
    const char *why = dlerror();

    PetscCall(Complain(message, len,
                       "Shape file %s cannot be loaded (%s): compile it again against this program's shape.h",
                       slot->file, why ? why : "unknown reason"));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  slot->plugin = (const ShapePlugin *)dlsym(slot->handle, "tumble_shape");
  PetscCall(CheckPlugin(slot->plugin, type, slot->file, message, len));
  PetscCall(PetscStrncpy(slot->type, type, sizeof(slot->type)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The table entry of a type, loaded now if it is not there yet. Collective. */
static PetscErrorCode GetPlugin(const char type[], const Loaded **loaded)
{
  Loaded         slot;
  char           path[MAX_PATHS + 2 * PETSC_MAX_PATH_LEN], message[4096];
  PetscErrorCode ierr;

  PetscFunctionBeginUser;
  PetscCheck(type && type[0] && !strchr(type, '/') && strlen(type) < sizeof(slot.type), ShapeComm(),
             PETSC_ERR_USER_INPUT,
             "Shape '%s' is not a type name: give the file name without folder and .so, and name the folder in -shape_path",
             type ? type : "");
  PetscCall(GetPath(path, sizeof(path))); /* read even if unused below, so that -shape_path counts as known */
  for (PetscInt i = 0; i < ntable; i++) {
    *loaded = &table[i];
    if (!strcmp(table[i].type, type)) PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCheck(ntable < MAX_PLUGINS, ShapeComm(), PETSC_ERR_SUP,
             "More than %d different shapes are loaded: raise MAX_PLUGINS in src/shape/shape.c", MAX_PLUGINS);
  PetscCall(PetscMemzero(&slot, sizeof(slot)));
  PetscCall(PetscMemzero(message, sizeof(message)));
  PetscCall(OpenPlugin(path, type, &slot, message, sizeof(message)));
  ierr = AgreeOnMessage(message, sizeof(message));
  if (ierr && slot.handle) dlclose(slot.handle);
  PetscCall(ierr);
  table[ntable] = slot;
  *loaded       = &table[ntable++];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- for plugins ---- */

PetscErrorCode ShapeGetDimension(Shape s, PetscInt *dim)
{
  PetscFunctionBeginUser;
  *dim = s->dim;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeSetData(Shape s, void *data)
{
  PetscFunctionBeginUser;
  s->data = data;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetData(Shape s, void *data)
{
  PetscFunctionBeginUser;
  *(void **)data = s->data;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetPrefix(Shape s, const char *prefix[])
{
  PetscFunctionBeginUser;
  *prefix = s->prefix;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeSetBound(Shape s)
{
  PetscFunctionBeginUser;
  s->bound = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Full option name from the short one; numeric ones are kept with their range for ShapeGetOption. */
static PetscErrorCode NameOption(Shape s, const char name[], OptSpec *spec, PetscBool numeric, char full[], size_t len)
{
  const PetscReal lower = spec->lower, upper = spec->upper;
  char            when[192];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(full, len, "-%s%s", s->prefix, name));
  PetscCall(PetscSNPrintf(when, sizeof(when), "-%sshape %s", s->prefix, s->loaded->type));
  spec->name = full;
  spec->when = when;
  PetscCall(OptDeclareOne(spec));
  if (numeric && s->noptions < SHAPE_MAX_OPTIONS) {
    OptionRange *o = &s->option[s->noptions++];

    PetscCall(PetscStrncpy(o->name, name, sizeof(o->name)));
    o->lower = lower;
    o->upper = upper;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeOptionReal(Shape s, const char name[], const char help[], const char unit[], PetscReal lower,
                               PetscReal upper, PetscReal *value)
{
  char    full[256], shown[32];
  OptSpec spec = {.type = OPT_REAL, .unit = unit, .lower = lower, .upper = upper, .value = shown, .help = help};

  PetscFunctionBeginUser;
  snprintf(shown, sizeof(shown), "%g", (double)*value);
  PetscCall(NameOption(s, name, &spec, PETSC_TRUE, full, sizeof(full)));
  PetscCall(OptReal(full, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeOptionInt(Shape s, const char name[], const char help[], PetscInt lower, PetscInt upper,
                              PetscInt *value)
{
  char    full[256], shown[32];
  OptSpec spec =
    {.type = OPT_INT, .unit = "", .lower = (double)lower, .upper = (double)upper, .value = shown, .help = help};

  PetscFunctionBeginUser;
  snprintf(shown, sizeof(shown), "%" PetscInt_FMT, *value);
  PetscCall(NameOption(s, name, &spec, PETSC_TRUE, full, sizeof(full)));
  PetscCall(OptInt(full, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeOptionRealArray(Shape s, const char name[], const char help[], const char unit[], PetscReal lower,
                                    PetscReal upper, PetscInt n, PetscReal value[])
{
  char    full[256];
  OptSpec spec = {.type = OPT_REALS, .unit = unit, .lower = lower, .upper = upper, .value = "", .help = help};

  PetscFunctionBeginUser;
  PetscCall(NameOption(s, name, &spec, PETSC_FALSE, full, sizeof(full)));
  PetscCall(OptRealArray(full, n, value, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ReadString(Shape s, const char name[], const char help[], OptPaths path, char value[], size_t len)
{
  char    full[256];
  OptSpec spec = {.type = OPT_STRING, .unit = "", .value = value, .help = help, .path = path};

  PetscFunctionBeginUser;
  PetscCall(NameOption(s, name, &spec, PETSC_FALSE, full, sizeof(full)));
  PetscCall(OptString(full, value, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeOptionString(Shape s, const char name[], const char help[], char value[], size_t len)
{
  return ReadString(s, name, help, OPT_NO_PATH, value, len);
}

PetscErrorCode ShapeOptionPath(Shape s, const char name[], const char help[], char value[], size_t len)
{
  PetscFunctionBeginUser;
  PetscCall(ReadString(s, name, help, OPT_PATH, value, len));
  s->from_file = (PetscBool)(value[0] != 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- create, destroy ---- */

/* Those that the record has; the others stay NULL */
static void take_operations(Shape s)
{
  const ShapePlugin *p    = s->loaded->plugin;
  size_t             size = sizeof(s->ops);

  if (p->interface == BEFORE_CORNERS) size = offsetof(ShapeOps, corners);
  else if (p->interface == BEFORE_TRIANGLES) size = offsetof(ShapeOps, triangles);
  memcpy(&s->ops, &p->ops, size);
}

static PetscErrorCode SetUpShape(Shape s)
{
  PetscFunctionBeginUser;
  if (s->ops.create) GUARDED(s, create, (s));
  if (s->ops.options) GUARDED(s, options, (s));
  if (s->ops.setup) GUARDED(s, setup, (s));
  PetscCall(ShapeCheck(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One shape that reads its options and is no more than that */
static PetscErrorCode DeclareOptions(const char type[])
{
  const Loaded *loaded = NULL;
  Shape         s;

  PetscFunctionBeginUser;
  PetscCall(GetPlugin(type, &loaded));
  PetscCall(PetscNew(&s));
  nalive++;
  s->loaded = loaded;
  take_operations(s);
  s->dim = loaded->plugin->dims & 2 ? 3 : 2;
  PetscCall(PetscStrncpy(s->prefix, "particle_<group>_", sizeof(s->prefix)));
  if (s->ops.create) GUARDED(s, create, (s));
  if (s->ops.options) GUARDED(s, options, (s));
  PetscCall(ShapeDestroy(&s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDeclareOptions(void)
{
  char path[MAX_PATHS + 2 * PETSC_MAX_PATH_LEN], known[2048], **type;
  int  n;

  PetscFunctionBeginUser;
  PetscCall(GetPath(path, sizeof(path)));
  PetscCall(ListKnown(path, known, sizeof(known)));
  PetscCall(PetscStrToArray(known, ',', &n, &type));
  for (int i = 0; i < n; i++) PetscCall(DeclareOptions(type[i] + strspn(type[i], " ")));
  PetscCall(PetscStrToArrayDestroy(n, type));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeCreate(const char type[], const char prefix[], PetscInt dim, Shape *shape)
{
  const Loaded  *loaded = NULL;
  Shape          s;
  PetscErrorCode ierr;

  PetscFunctionBeginUser;
  *shape = NULL;
  PetscCheck(dim == 2 || dim == 3, ShapeComm(), PETSC_ERR_ARG_OUTOFRANGE,
             "Dimension %" PetscInt_FMT " of a shape must be 2 or 3", dim);
  PetscCall(GetPlugin(type, &loaded));
  PetscCheck(loaded->plugin->dims & (dim == 2 ? 1 : 2), ShapeComm(), PETSC_ERR_USER_INPUT,
             "Shape '%s' works in %s only, the scene has dimension %" PetscInt_FMT
             ": choose another shape for -%sshape or another mesh",
             type, dim == 2 ? "3D" : "2D", dim, prefix);
  PetscCall(PetscNew(&s));
  nalive++;
  s->loaded = loaded;
  take_operations(s);
  s->dim = dim;
  PetscCall(PetscStrncpy(s->prefix, prefix ? prefix : "", sizeof(s->prefix)));
  ierr = SetUpShape(s);
  if (PetscUnlikely(ierr)) { /* free what the plugin has, so that a caller who goes on does not leak */
    PetscCall(ShapeDestroy(&s));
    PetscCall(ierr);
  }
  *shape = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDestroy(Shape *shape)
{
  Shape s = *shape;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->ops.destroy) GUARDED(s, destroy, (s));
  nalive--;
  PetscCall(PetscFree(s->corner));
  PetscCall(PetscFree(*shape));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeView(Shape s, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (!viewer) PetscCall(PetscViewerASCIIGetStdout(ShapeComm(), &viewer));
  PetscCall(PetscViewerASCIIPrintf(viewer, "Shape %s (%s): bounding radius %g, version %s, from %s\n", s->loaded->type,
                                   s->prefix, (double)s->radius,
                                   s->loaded->plugin->version ? s->loaded->plugin->version : "unknown",
                                   s->loaded->file));
  if (s->ops.view) {
    PetscCall(PetscViewerASCIIPushTab(viewer));
    GUARDED(s, view, (s, viewer));
    PetscCall(PetscViewerASCIIPopTab(viewer));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDescribe(Shape s, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (s->ops.view) GUARDED(s, view, (s, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeIsFromFile(Shape s, PetscBool *yes)
{
  PetscFunctionBeginUser;
  *yes = s->from_file;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetType(Shape s, const char *type[])
{
  PetscFunctionBeginUser;
  *type = s->loaded->type;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetPlugin(Shape s, const ShapePlugin **plugin)
{
  PetscFunctionBeginUser;
  *plugin = s->loaded->plugin;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetReach(Shape s, PetscReal *r)
{
  PetscFunctionBeginUser;
  *r = s->radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeIsBound(Shape s, PetscBool *bound)
{
  PetscFunctionBeginUser;
  *bound = s->bound;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetOption(Shape s, PetscInt i, const char *name[], PetscReal *lower, PetscReal *upper)
{
  PetscFunctionBeginUser;
  *name = NULL;
  if (i < 0 || i >= s->noptions) PetscFunctionReturn(PETSC_SUCCESS);
  *name  = s->option[i].name;
  *lower = s->option[i].lower;
  *upper = s->option[i].upper;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeFinalize(void)
{
  PetscFunctionBeginUser;
  PetscCheck(nalive == 0, PETSC_COMM_SELF, PETSC_ERR_ORDER,
             "%" PetscInt_FMT " shapes are still in use: call ShapeDestroy on each before ShapeFinalize", nalive);
  for (PetscInt i = 0; i < ntable; i++) dlclose(table[i].handle);
  ntable = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
