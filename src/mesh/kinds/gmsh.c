/* Mesh files: the mesh of a Gmsh file on rank 0 and its named boundaries (see kindimpl.h).

   What is wrong with a file is found on rank 0 and said by all. */
#include "compat.h"
#include "kindimpl.h"
#include "base/log.h"
#include "base/opt.h"
#include "celllist.h"
#include "filecells.h"
#include <ctype.h>

/* A physical group of edges (2D) or faces that may become a boundary */
typedef struct {
  char      name[MSH_NAME];
  PetscBool named;        /* or its number is the name */
  PetscInt  outer, inner; /* faces on the outside, between two cells */
} Group;

/* While a file becomes a mesh, on rank 0 */
typedef struct {
  Msh       msh;
  FileCells cells;
  PetscInt  ngroup, nface, fStart;
  Group    *group;
  PetscInt *face_group; /* [nface] -1: none */
  char      fault[MSH_FAULT], remark[3][MSH_FAULT], unnamed[MSH_NAME];
} Reading;

/* ---- names ---- */

/* What an option can be named by: what is no letter, digit, dash or '_' becomes '_' */
static void make_name(const char given[], char name[MSH_NAME])
{
  size_t n = 0;

  for (; given[n] && n + 1 < MSH_NAME; n++)
    name[n] = isalnum((unsigned char)given[n]) || given[n] == '-' || given[n] == '_' ? given[n] : '_';
  name[n] = 0;
}

/* The group of this physical number, made if it is new */
static PetscErrorCode find_group(Reading *r, PetscInt number, PetscInt *which)
{
  const char *given = MshGroupName(&r->msh, r->cells.dim - 1, number);
  char        name[MSH_NAME];

  PetscFunctionBeginUser;
  if (given) make_name(given, name);
  else (void)snprintf(name, sizeof(name), "%" PetscInt_FMT, number);
  for (*which = 0; *which < r->ngroup; (*which)++) {
    PetscBool same;

    PetscCall(PetscStrcasecmp(name, r->group[*which].name, &same));
    if (same) PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscRealloc(sizeof(Group) * (size_t)(r->ngroup + 1), &r->group));
  r->group[*which] = (Group){.named = (PetscBool)(given != NULL)};
  PetscCall(PetscStrncpy(r->group[*which].name, name, MSH_NAME));
  r->ngroup++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Groups whose names would be one and the same option */
static void check_names(Reading *r)
{
  const Msh *m = &r->msh;

  for (PetscInt i = 0; i < m->ngroup; i++) {
    for (PetscInt j = 0; j < i; j++) {
      char a[MSH_NAME], b[MSH_NAME];

      if (m->group[i].dim != r->cells.dim - 1 || m->group[j].dim != m->group[i].dim ||
          !strcmp(m->group[i].name, m->group[j].name))
        continue;
      make_name(m->group[i].name, a);
      make_name(m->group[j].name, b);
      if (!strcasecmp(a, b) && !*r->fault)
        (void)
          snprintf(r->fault, MSH_FAULT,
                   "has the physical names '%.60s' and '%.60s', which are one in options (-flow_bc_%s_type; what is no letter or digit counts as '_', "
                   "upper case as lower): rename one of them",
                   m->group[j].name, m->group[i].name, a);
    }
  }
}

/* ---- faces ---- */

/* The face of the DM with the corners of an element, -1: no cell has it */
static PetscErrorCode find_face(const Reading *r, DM dm, const MshElement *e, PetscInt *face)
{
  const PetscInt  ncorner = 1 << (r->cells.dim - 1);
  PetscInt        corner[4], n;
  const PetscInt *join;

  PetscFunctionBeginUser;
  *face = -1;
  for (PetscInt i = 0; i < ncorner; i++) {
    const PetscInt v = r->cells.vertex[r->msh.node[e->start + i]];

    if (v < 0) PetscFunctionReturn(PETSC_SUCCESS);
    corner[i] = r->cells.ncell + v;
  }
  PetscCall(DMPlexGetFullJoin(dm, ncorner, corner, &n, &join));
  if (n == 1) *face = join[0];
  PetscCall(DMPlexRestoreJoin(dm, ncorner, corner, &n, &join));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A face gets a group; a name counts more than a number */
static void give_group(Reading *r, PetscInt face, PetscBool outer, PetscInt group)
{
  PetscInt *mine = r->face_group + face - r->fStart;

  if (*mine == group || (*mine >= 0 && !r->group[group].named)) return;
  if (outer && *mine >= 0 && r->group[*mine].named)
    (void)
      snprintf(r->fault, MSH_FAULT,
               "gives an edge or face two names, '%s' and '%s': each needs one physical name, save it again with one",
               r->group[*mine].name, r->group[group].name);
  *mine = group;
}

static PetscErrorCode give_groups(Reading *r, DM dm)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < r->msh.nelement && !*r->fault; i++) {
    const MshElement *e = r->msh.element + i;
    PetscInt          face, support, group;

    if (e->type->dim != r->cells.dim - 1 || !e->group[0]) continue;
    if (r->cells.dim == 3 && e->type->shape[0] != 'q') continue;
    PetscCall(find_face(r, dm, e, &face));
    if (face < 0) continue;
    PetscCall(DMPlexGetSupportSize(dm, face, &support));
    for (PetscInt k = 0; k < 2 && e->group[k]; k++) {
      PetscCall(find_group(r, e->group[k], &group));
      give_group(r, face, (PetscBool)(support == 1), group);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Faces on the outside without a group */
typedef struct {
  PetscInt  n, outer; /* all faces on the outside */
  PetscInt  twice;    /* that lie on others */
  PetscInt  crowded;  /* all faces with more than two cells */
  PetscReal first[3], lower[3], upper[3];
} Nameless;

static PetscErrorCode count_faces(Reading *r, DM dm, Nameless *less)
{
  PetscReal *key, (*x)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(less, sizeof(*less)));
  PetscCall(PetscMalloc2(r->nface, &key, r->nface, &x));
  for (PetscInt f = 0; f < r->nface; f++) {
    PetscInt support;
    Group   *g = r->face_group[f] < 0 ? NULL : r->group + r->face_group[f];

    PetscCall(DMPlexGetSupportSize(dm, r->fStart + f, &support));
    less->crowded += support > 2;
    less->outer += support == 1;
    if (g) g->outer += support == 1;
    if (g) g->inner += support != 1;
    if (g || support != 1) continue;
    x[less->n][2] = 0;
    PetscCall(DMPlexComputeCellGeometryFVM(dm, r->fStart + f, NULL, x[less->n], NULL));
    for (PetscInt d = 0; d < 3; d++) {
      const PetscReal at = x[less->n][d];

      if (less->n == 0) less->first[d] = less->lower[d] = less->upper[d] = at;
      less->lower[d] = PetscMin(less->lower[d], at);
      less->upper[d] = PetscMax(less->upper[d], at);
    }
    key[less->n] = x[less->n][0] + 0.6180339887 * x[less->n][1] + 0.3247179572 * x[less->n][2];
    less->n++;
  }
  PetscCall(PetscSortReal(less->n, key)); /* places that agree have keys that do */
  for (PetscInt i = 1; i < less->n; i++)
    less->twice += key[i] - key[i - 1] <= 1e-12 * (PetscAbsReal(key[0]) + PetscAbsReal(key[less->n - 1]));
  PetscCall(PetscFree2(key, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void print_position(PetscInt dim, const PetscReal x[], char text[64])
{
  if (dim == 2) (void)snprintf(text, 64, "(%g, %g)", (double)x[0], (double)x[1]);
  else (void)snprintf(text, 64, "(%g, %g, %g)", (double)x[0], (double)x[1], (double)x[2]);
}

/* Faces without a name are open without anybody having said so */
static void check_faces(Reading *r, const Nameless *less)
{
  const PetscInt    dim  = r->cells.dim;
  const char *const what = dim == 2 ? "edges" : "faces", *const kind = dim == 2 ? "Curve" : "Surface";
  char first[64], lower[64], upper[64];

  print_position(dim, less->first, first);
  print_position(dim, less->lower, lower);
  print_position(dim, less->upper, upper);
  if (less->crowded)
    (void)snprintf(r->fault, MSH_FAULT,
                   "has %" PetscInt_FMT
                   " %s with more than two cells: cells lie on each other, or are in the file twice",
                   less->crowded, what);
  else if (less->twice)
    (void)
      snprintf(r->fault, MSH_FAULT,
               "is not joined: %" PetscInt_FMT
               " %s without a name lie on others, the first at %s, all from %s to %s: write Coherence; before meshing "
               "(or Coherence Mesh; after it) in Gmsh",
               less->twice, what, first, lower, upper);
  else if (less->n && less->n < less->outer && !r->unnamed[0])
    (void)
      snprintf(r->fault, MSH_FAULT,
               "names its boundaries, but %" PetscInt_FMT
               " %s of the outside have no name, the first at %s, all from %s to %s, and the fluid "
               "would pass there: give them one in Gmsh, Physical %s(\"wall\") = {...};, and save the file again, or name them all with "
               "-mesh_unnamed wall",
               less->n, what, first, lower, upper, kind);
}

/* Parts that a file tells apart, as a solid in the fluid, are one here; a volume whose cells the file lacks */
static void remark_regions(Reading *r)
{
  const Msh *m      = &r->msh;
  PetscInt   region = 0;
  PetscInt   first  = -1;

  for (PetscInt i = 0; i < m->nentity; i++)
    if (m->entity[i].dim > r->cells.dim)
      (void)
        snprintf(r->remark[2], MSH_FAULT,
                 "has a volume without cells, and is taken for a mesh of the plane: for one in space give the volume a physical name too");
  for (PetscInt i = 0; i < m->nelement && !region; i++) {
    const MshElement *e = m->element + i;

    if (e->type->dim != r->cells.dim) continue;
    if (first < 0) first = e->group[0];
    if (e->group[0] != first) region = e->group[0] ? e->group[0] : first;
  }
  if (region)
    (void)snprintf(r->remark[2], MSH_FAULT, "has several parts, such as the group of cells '%s': all of them are fluid",
                   MshGroupName(m, r->cells.dim, region) ? MshGroupName(m, r->cells.dim, region) : "without a name");
}

/* ---- boundaries ---- */

static PetscErrorCode add_boundary(MeshKind k, const char name[])
{
  PetscFunctionBeginUser;
  if (k->nboundary++ < MAX_BOUNDARIES)
    PetscCall(PetscStrncpy(k->boundary[k->nboundary - 1], name, sizeof(k->boundary[0])));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Groups inside are no boundaries, unless -mesh_plates names them */
static PetscErrorCode is_plate(const char name[], PetscInt n, char *const plate[], PetscBool *is)
{
  PetscFunctionBeginUser;
  *is = PETSC_FALSE;
  for (PetscInt i = 0; i < n && !*is; i++) {
    char wanted[MSH_NAME];

    make_name(plate[i], wanted);
    PetscCall(PetscStrcasecmp(wanted, name, is));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode name_boundaries(MeshKind k, Reading *r, const Nameless *less, PetscInt nplate,
                                      char *const plate[])
{
  const char *const what = r->cells.dim == 2 ? "edges" : "faces";

  PetscFunctionBeginUser;
  if (less->n && r->unnamed[0]) PetscCall(add_boundary(k, r->unnamed));
  if (less->n == less->outer && !r->unnamed[0]) {
    PetscCall(add_boundary(k, "boundary"));
    (void)snprintf(r->remark[0], MSH_FAULT,
                   "has no physical names on its outside: all %" PetscInt_FMT
                   " %s of it are one boundary, 'boundary', a wall unless "
                   "-flow_bc_boundary_type says otherwise",
                   less->outer, what);
  }
  for (PetscInt g = 0; g < r->ngroup; g++) {
    const Group *group = r->group + g;
    PetscBool    inside;

    PetscCall(is_plate(group->name, nplate, plate, &inside));
    if (less->n && !strcasecmp(group->name, r->unnamed)) {
      if (!strcmp(group->name, r->unnamed)) continue; /* these join it */
      (void)snprintf(r->fault, MSH_FAULT, "has a boundary '%s' already: write -mesh_unnamed %s", group->name,
                     group->name);
    }
    if (group->outer || inside) PetscCall(add_boundary(k, group->name));
    if (group->inner && group->named && !inside && !r->remark[1][0])
      (void)
        snprintf(r->remark[1], MSH_FAULT,
                 "has %" PetscInt_FMT
                 " %s named '%s' between cells: they are no boundary, and the fluid passes (-mesh_plates %s makes thin walls of "
                 "them)",
                 group->inner, what, group->name, group->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode label_faces(const Reading *r, DM dm, PetscInt nplate, char *const plate[])
{
  PetscFunctionBeginUser;
  for (PetscInt f = 0; f < r->nface; f++) {
    const PetscInt g    = r->face_group[f];
    const char    *name = g >= 0 ? r->group[g].name : r->unnamed[0] ? r->unnamed : "boundary";
    PetscInt       support;
    PetscBool      inside = PETSC_FALSE;

    PetscCall(DMPlexGetSupportSize(dm, r->fStart + f, &support));
    if (g >= 0) PetscCall(is_plate(name, nplate, plate, &inside));
    if (support == 1 || inside) PetscCall(DMSetLabelValue(dm, name, r->fStart + f, 1));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_plates(MeshKind k, PetscInt nplate, char *const plate[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < nplate; i++) {
    PetscBool found = PETSC_FALSE;

    for (PetscInt b = 0; b < k->nboundary && !found; b++) PetscCall(is_plate(k->boundary[b], 1, plate + i, &found));
    PetscCheck(found, k->comm, PETSC_ERR_USER_INPUT,
               "Option -mesh_plates: mesh file '%s' has no edges or faces named '%s'", k->file, plate[i]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All ranks stop if the file is wrong */
static PetscErrorCode stop_together(MeshKind k, Reading *r)
{
  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Bcast(r->fault, MSH_FAULT, MPI_CHAR, 0, k->comm));
  PetscCheck(!*r->fault, k->comm, PETSC_ERR_USER_INPUT, "Mesh file '%s' %s", k->file, r->fault);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_boundaries(MeshKind k, Reading *r, DM dm)
{
  const char *const taken[] = {"depth", "celltype", NULL};
  PetscInt          fEnd, nplate                           = MAX_BOUNDARIES;
  char             *plate[MAX_BOUNDARIES], given[MSH_NAME] = "";
  Nameless          less;
  PetscMPIInt       rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(k->comm, &rank));
  PetscCall(OptStringArray("-mesh_plates", &nplate, plate));
  PetscCall(OptString("-mesh_unnamed", given, sizeof(given)));
  make_name(given, r->unnamed);
  PetscCall(DMPlexGetHeightStratum(dm, 1, &r->fStart, &fEnd));
  r->nface = fEnd - r->fStart;
  PetscCall(PetscMalloc1(r->nface, &r->face_group));
  for (PetscInt f = 0; f < r->nface; f++) r->face_group[f] = -1;
  if (rank == 0) {
    check_names(r);
    remark_regions(r);
    PetscCall(give_groups(r, dm));
    PetscCall(count_faces(r, dm, &less));
    if (!*r->fault) check_faces(r, &less);
    if (!*r->fault) PetscCall(name_boundaries(k, r, &less, nplate, plate));
  }
  PetscCall(stop_together(k, r));
  PetscCallMPI(MPI_Bcast(&k->nboundary, 1, MPIU_INT, 0, k->comm));
  PetscCallMPI(MPI_Bcast(k->boundary, sizeof(k->boundary), MPI_CHAR, 0, k->comm));
  PetscCallMPI(MPI_Bcast(r->remark, sizeof(r->remark), MPI_CHAR, 0, k->comm));
  PetscCheck(k->nboundary <= MAX_BOUNDARIES, k->comm, PETSC_ERR_SUP,
             "Mesh file '%s' has %" PetscInt_FMT
             " boundaries, at most %d are possible: give several of them one physical name",
             k->file, k->nboundary, MAX_BOUNDARIES);
  for (PetscInt b = 0; b < k->nboundary; b++) {
    for (PetscInt i = 0; taken[i]; i++)
      PetscCheck(strcmp(k->boundary[b], taken[i]), k->comm, PETSC_ERR_USER_INPUT,
                 "Mesh file '%s' has a boundary named '%s', a word of PETSc's: rename it", k->file, taken[i]);
    PetscCall(DMCreateLabel(dm, k->boundary[b]));
  }
  PetscCall(check_plates(k, nplate, plate));
  PetscCall(label_faces(r, dm, nplate, plate));
  for (PetscInt i = 0; i < nplate; i++) PetscCall(PetscFree(plate[i]));
  for (PetscInt i = 0; i < 3; i++)
    if (r->remark[i][0]) PetscCall(LogRemark("mesh file '%s' %s", k->file, r->remark[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells ---- */

/* -mesh_scale, -mesh_offset: places as the scene wants them */
static PetscErrorCode place_nodes(MeshKind k, Reading *r)
{
  PetscReal scale = 1, offset[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(OptReal("-mesh_scale", &scale));
  PetscCall(OptRealArray("-mesh_offset", k->dim, offset, NULL));
  for (PetscInt i = 0; i < 3 * r->msh.nnode; i++) r->msh.x[i] = scale * r->msh.x[i] + offset[i % 3];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Corners and cells, in the order of the file */
static PetscErrorCode list_cells(const Reading *r, CellList *l)
{
  const FileCells *f                = &r->cells;
  const PetscInt   lattice_index[8] = {0, 2, 8, 6, 18, 20, 26, 24};
  PetscInt         id;

  PetscFunctionBeginUser;
  PetscCall(CellListCreate(f->dim, f->nvertex, f->ncell, l));
  for (PetscInt i = 0; i < r->msh.nnode; i++)
    if (f->vertex[i] >= 0) PetscCall(CellListAddVertex(l, r->msh.x + 3 * i, &id));
  for (PetscInt c = 0; c < f->ncell; c++) {
    PetscInt corner[8];

    for (PetscInt i = 0; i < 1 << f->dim; i++) corner[i] = f->vertex[f->lattice[c * f->nb + lattice_index[i]]];
    PetscCall(CellListAddCell(l, corner));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode keep_curved(MeshKind k, const Reading *r, DM dm)
{
  const FileCells *f      = &r->cells;
  PetscInt         curved = f->curved;
  PetscReal       *x      = NULL;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Bcast(&curved, 1, MPIU_INT, 0, k->comm));
  if (!curved) PetscFunctionReturn(PETSC_SUCCESS);
  if (f->ncell) PetscCall(PetscMalloc1(f->ncell * f->nb * f->dim, &x));
  for (PetscInt c = 0; c < f->ncell; c++) FileCellsPositions(&r->msh, f, c, x + c * f->nb * f->dim);
  PetscCall(CurvedCreate(k->comm, k->dim, f->ncell, x, &k->curved));
  PetscCall(CurvedMark(k->curved, dm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode remark_turned(MeshKind k, const Reading *r)
{
  PetscInt n[2] = {r->cells.turned, r->cells.ncell};

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Bcast(n, 2, MPIU_INT, 0, k->comm));
  if (n[0])
    PetscCall(LogRemark("mesh file '%s' has %" PetscInt_FMT " of %" PetscInt_FMT
                        " cells that go round %s: they were turned",
                        k->file, n[0], n[1], k->dim == 2 ? "clockwise" : "left-handed"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshKindCreateFromFile(MeshKind k, DM *dm)
{
  Reading     r = {.ngroup = 0};
  CellList    l = {0};
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(k->comm, &rank));
  if (rank == 0) PetscCall(MshRead(k->file, &r.msh, r.fault));
  if (rank == 0 && !*r.fault) PetscCall(FileCellsFind(&r.msh, &r.cells, r.fault));
  if (rank == 0 && r.msh.periodic && !*r.fault)
    (void)snprintf(r.fault, MSH_FAULT,
                   "is periodic, which works for boxes only (-mesh_periodic): remove the periodic pairs from the file");
  PetscCall(stop_together(k, &r));
  k->dim = r.cells.dim;
  PetscCallMPI(MPI_Bcast(&k->dim, 1, MPIU_INT, 0, k->comm));
  k->map.dim = k->dim;
  PetscCall(place_nodes(k, &r));
  if (rank == 0) PetscCall(list_cells(&r, &l));
  PetscCall(CellListCreateDM(k->comm, k->dim, &l, 0, dm));
  PetscCall(CellListClear(&l));
  PetscCall(find_boundaries(k, &r, *dm));
  PetscCall(keep_curved(k, &r, *dm));
  PetscCall(remark_turned(k, &r));
  PetscCall(MshClear(&r.msh));
  PetscCall(FileCellsClear(&r.cells));
  PetscCall(PetscFree(r.group));
  PetscCall(PetscFree(r.face_group));
  PetscFunctionReturn(PETSC_SUCCESS);
}
