/* Solids: see solid/solid.h. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "base/rigid.h"
#include "shape/material.h"

#define MAX_WATCH 64  /* numbers */
#define FAR       0.5 /* a watched point may be so many cells from the nearest node */

/* ---- options of a group ---- */

/* name: the first of the options -particle_<group><suffix> that is given, "" if none is */
static PetscErrorCode find_given(const char group[], size_t n, const char *const suffix[], char name[OPT_NAME])
{
  PetscBool given = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (size_t i = 0; i < n && !given; i++) PetscCall(OptHas(OptJoin("-particle_", group, suffix[i], name), &given));
  if (!given) name[0] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Options of surfaces that move beside the motion of rigid bodies */
static PetscErrorCode refuse_slip(const char group[])
{
  static const char *const SLIP[] = {"_slip_modes", "_slip_velocity", "_slip_direction", "_slip_mobility",
                                     "_slip_scalar"};
  char                     name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(find_given(group, PETSC_STATIC_ARRAY_LENGTH(SLIP), SLIP, name));
  PetscCheck(!name[0], PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%s is for rigid bodies, and group '%s' is elastic: remove it, or give -particle_%s_material rigid", name,
             group, group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What is of solids alone: a membrane has no volume, and what is in it is a fluid of the same density */
static PetscErrorCode refuse_of_solids(const char group[])
{
  static const char *const OF_SOLIDS[] = {"_density", "_shear_modulus", "_poisson", "_solid_viscosity"};
  char                     name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(find_given(group, PETSC_STATIC_ARRAY_LENGTH(OF_SOLIDS), OF_SOLIDS, name));
  PetscCheck(!name[0], PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%s: group '%s' is a membrane, which has a -particle_%s_surface_modulus and inside a fluid of the density around it, with a "
             "-particle_%s_viscosity: remove it",
             name, group, group, group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_membrane(SolidGroup *g)
{
  static const char *const LAWS[] = {"neo_hookean", "skalak", "zero_thickness", NULL};
  char                     name[OPT_NAME];
  PetscInt                 law = 0;

  PetscFunctionBeginUser;
  PetscCall(refuse_of_solids(g->name));
  PetscCall(OptChoice(OptJoin("-particle_", g->name, "_membrane_law", name), LAWS, &law));
  g->material.law = (SolidLaw)(SOLID_MEMBRANE_NEO_HOOKEAN + law);
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_surface_modulus", name), &g->material.mu));
  PetscCheck(g->material.mu > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' is a membrane and has no surface modulus: give %s", g->name, name);
  g->material.area = g->material.law == SOLID_MEMBRANE_SKALAK ? g->material.mu : 0;
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_area_modulus", name), &g->material.area));
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_bending", name), &g->material.bending));
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_global_area_modulus", name), &g->material.global));
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_viscosity", name), &g->inner_viscosity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_material(SolidGroup *g)
{
  char      name[OPT_NAME];
  PetscReal poisson = 0.5;

  PetscFunctionBeginUser;
  PetscCall(refuse_slip(g->name));
  if (g->membrane) {
    PetscCall(read_membrane(g));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_shear_modulus", name), &g->material.mu));
  PetscCheck(g->material.mu > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' is elastic and has no shear modulus: give %s", g->name, name);
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_poisson", name), &poisson));
  g->compressible    = (PetscBool)(poisson < 0.5);
  g->material.lambda = g->compressible ? 2 * g->material.mu * poisson / (1 - 2 * poisson) : 0;
  g->material.bulk   = g->compressible ? 0 : SOLID_BULK * g->material.mu;
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_solid_viscosity", name), &g->viscosity));
  g->density = 1;
  PetscCall(OptReal(OptJoin("-particle_", g->name, "_density", name), &g->density));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_mesh(SolidGroup *g, PetscInt dim, PetscReal size)
{
  char      name[OPT_NAME];
  PetscInt  cells[3] = {0};
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(ParticleCreateShape(g->name, dim, &g->shape));
  PetscCall(OptIntArray(OptJoin("-particle_", g->name, "_solid_cells", name), dim, cells, &given));
  if (!given) PetscCall(OptReal(OptJoin("-particle_", g->name, "_solid_size", name), &size));
  PetscCall((g->membrane ? SolidMeshCreateMembrane : SolidMeshCreate)(g->shape, g->name, dim, cells, size, &g->mesh));
  g->stiffness = g->membrane ? g->material.mu / g->mesh.radius : g->material.mu;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The node of a solid at X [nnode][dim] nearest to each point that is watched */
static PetscErrorCode read_watch(SolidGroup *g, PetscInt dim, const PetscReal X[])
{
  char      name[OPT_NAME];
  PetscInt  n;
  PetscReal at[MAX_WATCH];

  PetscFunctionBeginUser;
  PetscCall(OptCountItems(OptJoin("-particle_", g->name, "_watch", name), &n));
  if (!n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(n % dim == 0 && n <= MAX_WATCH, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s has %" PetscInt_FMT " numbers: give %" PetscInt_FMT " for each point, at most %d", name, n, dim,
             MAX_WATCH);
  PetscCall(OptRealArray(name, n, at, NULL));
  g->nwatch = n / dim;
  PetscCall(PetscMalloc2(g->nwatch, &g->watch, n, &g->watched));
  PetscCall(PetscArraycpy(g->watched, at, n));
  for (PetscInt w = 0; w < g->nwatch; w++) {
    PetscReal best = PETSC_MAX_REAL;

    for (PetscInt i = 0; i < g->mesh.nnode; i++) {
      PetscReal d2 = 0;

      for (PetscInt a = 0; a < dim; a++) d2 += PetscSqr(X[dim * i + a] - at[dim * w + a]);
      if (d2 >= best) continue;
      best        = d2;
      g->watch[w] = i;
    }
    PetscCheck(PetscSqrtReal(best) <= FAR * g->mesh.h, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s: point %" PetscInt_FMT
               " is %g away from the solid of group '%s': give points of it, where it starts",
               name, w + 1, (double)PetscSqrtReal(best), g->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes that are held, of the first solid, at X [nnode][dim] */
static PetscErrorCode read_clamp(SolidGroup *g, const PetscReal X[])
{
  char      name[OPT_NAME];
  PetscReal all = 0, *value;
  PetscBool found;
  Expr      expr = NULL;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(g->mesh.nnode, &g->clamped));
  PetscCall(ExprRead(OptJoin("-particle_", g->name, "_clamp", name), g->mesh.dim, 1, &all, &expr, &found));
  if (!found) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(g->mesh.nnode, &value));
  for (PetscInt i = 0; i < g->mesh.nnode; i++) value[i] = all;
  if (expr) PetscCall(ExprEvaluate(expr, 0, g->mesh.nnode, X, value));
  PetscCall(ExprDestroy(&expr));
  for (PetscInt i = 0; i < g->mesh.nnode; i++) {
    g->clamped[i] = (PetscBool)(value[i] > 0);
    g->nclamped += g->clamped[i];
  }
  PetscCall(PetscFree(value));
  PetscCheck(g->nclamped, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s holds no node of the solid: it is to be above zero at some of its nodes, of size %g, where it starts",
             name, (double)g->mesh.h);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode list_groups(Solids b)
{
  ParticleGroup *list;

  PetscFunctionBeginUser;
  PetscCall(ParticleListGroups(MATERIAL_NEO_HOOKEAN, MATERIAL_MEMBRANE, &b->s.ngroups, &list));
  PetscCall(PetscCalloc1(b->s.ngroups, &b->group));
  for (PetscInt g = 0; g < b->s.ngroups; g++) {
    b->group[g].material.law = list[g].material == MATERIAL_NEO_HOOKEAN ? SOLID_NEO_HOOKEAN : SOLID_ST_VENANT_KIRCHHOFF;
    b->group[g].membrane     = (PetscBool)(list[g].material == MATERIAL_MEMBRANE);
    PetscCall(PetscStrncpy(b->group[g].name, list[g].name, sizeof(b->group[g].name)));
  }
  PetscCall(PetscFree(list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solids of the groups, one after the other */
static PetscErrorCode number_solids(Solids b)
{
  SolidsState *s = &b->s;
  PetscInt     k = 0, n;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(s->n, &b->group_of, s->n + 1, &b->first));
  b->first[0] = 0;
  for (PetscInt g = 0; g < s->ngroups; g++)
    for (PetscInt i = 0; i < b->group[g].count; i++, k++) {
      b->group_of[k]  = g;
      b->first[k + 1] = b->first[k] + b->group[g].mesh.nnode;
    }
  s->nnode = b->first[s->n];
  n        = s->nnode * s->dim;
  PetscCall(PetscCalloc6(n, &s->X, n, &s->x, n, &s->x_old, n, &s->u, n, &s->u_old, s->n, &s->tension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ranks get about the same number of nodes, in whole solids */
static PetscErrorCode distribute(Solids b)
{
  SolidsState *s = &b->s;
  PetscMPIInt  rank, size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(b->comm, &rank));
  PetscCallMPI(MPI_Comm_size(b->comm, &size));
  PetscCall(PetscMalloc1(size + 1, &b->start));
  for (PetscInt r = 0, k = 0; r <= size; r++) {
    while (k < s->n && (PetscInt64)size * b->first[k] < (PetscInt64)r * s->nnode) k++;
    b->start[r] = k;
  }
  s->own[0] = b->start[rank];
  s->own[1] = b->start[rank + 1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Options that say where a point of the one solid of a group is */
static PetscErrorCode refuse_points(const SolidGroup *g)
{
  static const char *const OF_ONE[] = {"_clamp", "_watch"};

  PetscFunctionBeginUser;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(OF_ONE) && g->count > 1; i++) {
    char      name[OPT_NAME];
    PetscBool given;

    PetscCall(OptHas(OptJoin("-particle_", g->name, OF_ONE[i], name), &given));
    PetscCheck(!given, PETSC_COMM_SELF, PETSC_ERR_SUP,
               "%s is for groups of one elastic particle, and group '%s' has %" PetscInt_FMT
               ": remove it, or give each its own group",
               name, g->name, g->count);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rigid velocities that are given, about the centroids of the solids of a group with nodes X, for start and state */
static PetscErrorCode set_velocities(Solids b, SolidGroup *g, const Placement place[], const PetscReal X[])
{
  const PetscInt dim = b->s.dim, slots = RigidSize(dim);
  PetscReal     *u = b->s.u + b->s.dim * b->first[g->first];

  PetscFunctionBeginUser;
  PetscCheck(!g->nclamped, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "Group '%s' starts with a velocity (-particle_%s_velocity, _angular_velocity or a table) and is held by -particle_%s_clamp: remove one "
             "of them",
             g->name, g->name, g->name);
  PetscCall(PetscMalloc1(g->count * slots, &g->start));
  for (PetscInt i = 0; i < g->count; i++) {
    PetscReal *U = g->start + i * slots;
    SolidSums  sums;

    for (PetscInt a = 0; a < slots; a++) U[a] = RigidValue(dim, place[i].u, place[i].omega, a);
    SolidMeasure(&g->mesh, &g->material, X + i * g->mesh.nnode * dim, &sums);
    for (PetscInt j = i * g->mesh.nnode; j < (i + 1) * g->mesh.nnode; j++) {
      PetscReal r[3] = {0, 0, 0};

      for (PetscInt a = 0; a < dim; a++) r[a] = X[j * dim + a] - sums.centroid[a];
      RigidVelocityAt(dim, U, r, u + j * dim);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* X of the solids of a group, and what goes by it; moves: their velocities are given */
static PetscErrorCode place_solids(Solids b, SolidGroup *g, const Placement place[], PetscBool moves)
{
  PetscReal *X = b->s.X + b->s.dim * b->first[g->first];

  PetscFunctionBeginUser;
  PetscCall(refuse_points(g));
  PetscCall(SolidGroupPlace(g, b->s.dim, place, X));
  PetscCall(read_clamp(g, X));
  PetscCall(read_watch(g, b->s.dim, X));
  if (moves) PetscCall(set_velocities(b, g, place, X));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of groups that are there: meshes, solids, places */
static PetscErrorCode create_groups(Solids b, PetscReal size, const PetscReal lower[3], const PetscReal upper[3])
{
  SolidsState    *s      = &b->s;
  ParticlesPlaced placed = {.n = 0};
  Placement     **place;
  PetscBool      *moves;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(s->ngroups, &place, s->ngroups, &moves));
  for (PetscInt i = 0; i < s->ngroups; i++) {
    SolidGroup *g = b->group + i;

    PetscCall(read_material(g));
    PetscCall(create_mesh(g, s->dim, size));
    PetscCall(ParticleReadPlacements(g->name, "elastic particles", s->dim, g->mesh.radius, lower, upper, &placed,
                                     &g->count, &place[i], &moves[i]));
    g->first = s->n;
    s->n += g->count;
  }
  PetscCall(number_solids(b));
  PetscCall(distribute(b));
  for (PetscInt i = 0; i < s->ngroups; i++) {
    PetscCall(place_solids(b, b->group + i, place[i], moves[i]));
    PetscCall(PetscFree(place[i]));
  }
  PetscCall(PetscFree2(place, moves));
  PetscCall(ParticlesPlacedDestroy(&placed));
  PetscCall(PetscArraycpy(s->x, s->X, s->nnode * s->dim));
  PetscCall(PetscArraycpy(s->x_old, s->X, s->nnode * s->dim));
  PetscCall(PetscArraycpy(s->u_old, s->u, s->nnode * s->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsCreate(MPI_Comm comm, PetscInt dim, PetscReal size, const PetscReal lower[3],
                            const PetscReal upper[3], Solids *solids)
{
  Solids b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  b->comm   = comm;
  b->s.dim  = dim;
  b->s.comm = comm;
  *solids   = b;
  PetscCall(list_groups(b));
  if (!b->s.ngroups) {
    PetscCall(SolidsDestroy(solids));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(create_groups(b, size, lower, upper));
  b->s.group    = b->group;
  b->s.group_of = b->group_of;
  b->s.first    = b->first;
  b->s.start    = b->start;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsDestroy(Solids *solids)
{
  Solids b = *solids;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SolidNewtonDestroy(b));
  for (PetscInt g = 0; g < b->s.ngroups; g++) {
    PetscCall(ShapeDestroy(&b->group[g].shape));
    PetscCall(SolidMeshDestroy(&b->group[g].mesh));
    PetscCall(PetscFree(b->group[g].start));
    PetscCall(PetscFree(b->group[g].clamped));
    PetscCall(PetscFree2(b->group[g].watch, b->group[g].watched));
  }
  PetscCall(PetscFree(b->group));
  PetscCall(PetscFree2(b->group_of, b->first));
  PetscCall(PetscFree(b->start));
  PetscCall(PetscFree6(b->s.X, b->s.x, b->s.x_old, b->s.u, b->s.u_old, b->s.tension));
  PetscCall(PetscFree(*solids));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsGetState(Solids b, SolidsState **state)
{
  PetscFunctionBeginUser;
  *state = &b->s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool SolidsHaveInnerFluid(Solids b)
{
  for (PetscInt g = 0; g < b->s.ngroups; g++)
    if (b->group[g].inner_viscosity > 0) return PETSC_TRUE;
  return PETSC_FALSE;
}

PetscInt SolidsCountGlobalAreas(Solids b)
{
  PetscInt n = 0;

  for (PetscInt g = 0; g < b->s.ngroups; g++)
    if (b->group[g].material.global > 0) n += b->group[g].count;
  return n;
}

PetscErrorCode SolidsView(Solids b, PetscViewer viewer)
{
  static const char *const LAW[] = {"neo_hookean", "st_venant_kirchhoff", "neo_hookean membrane", "skalak membrane",
                                    "zero_thickness membrane"};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < b->s.ngroups; i++) {
    const SolidGroup *g = b->group + i;

    PetscCall(PetscViewerASCIIPrintf(viewer,
                                     "elastic group '%s': %" PetscInt_FMT " of %s, %" PetscInt_FMT
                                     " cells of size %.3g, %" PetscInt_FMT " nodes (%" PetscInt_FMT
                                     " held), %s modulus %g, %s %g%s\n",
                                     g->name, g->count, LAW[g->material.law], g->mesh.ncell, (double)g->mesh.h,
                                     g->mesh.nnode, g->nclamped, g->membrane ? "surface" : "shear",
                                     (double)g->material.mu, g->membrane ? "area modulus" : "Lame's first",
                                     (double)(g->membrane ? g->material.area : g->material.lambda),
                                     g->compressible || g->membrane ? "" : " (incompressible)"));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- state ---- */

void SolidsMeasure(Solids b, PetscInt k, SolidSums *sums)
{
  const SolidGroup *g = b->group + b->group_of[k];

  SolidMeasure(&g->mesh, &g->material, b->s.x + b->s.dim * b->first[k], sums);
}

/* bound [n + 1]: where in v what is of a solid begins, times the width; NULL: with its number */
static PetscErrorCode exchange_values(const SolidsState *s, const PetscInt bound[], PetscInt width, PetscReal v[])
{
  PetscMPIInt size, *count, *at;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(s->comm, &size));
  if (size == 1) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc2(size, &count, size, &at));
  for (PetscMPIInt r = 0; r < size; r++) {
    const PetscInt first = s->start[r], last = s->start[r + 1];

    PetscCall(PetscMPIIntCast(width * (bound ? bound[first] : first), &at[r]));
    PetscCall(PetscMPIIntCast(width * (bound ? bound[last] - bound[first] : last - first), &count[r]));
  }
  PetscCallMPI(MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, v, count, at, MPIU_REAL, s->comm));
  PetscCall(PetscFree2(count, at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsExchange(const SolidsState *s, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(exchange_values(s, NULL, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsExchangeNodes(const SolidsState *s, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(exchange_values(s, s->first, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsAccept(Solids b, PetscReal dt, const PetscReal x[], const PetscReal u[], const PetscReal tension[])
{
  SolidsState   *s = &b->s;
  const PetscInt n = s->nnode * s->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(s->x_old, s->x, n));
  PetscCall(PetscArraycpy(s->u_old, s->u, n));
  PetscCall(PetscArraycpy(s->x, x, n));
  PetscCall(PetscArraycpy(s->u, u, n));
  if (tension) PetscCall(PetscArraycpy(s->tension, tension, s->n));
  s->time_dt = dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidsVisitState(void *solids, State state)
{
  SolidsState   *s = &((Solids)solids)->s;
  const PetscInt n = s->nnode * s->dim;
  PetscBool      has;

  PetscFunctionBeginUser;
  PetscCall(StateReals(state, "dt", 1, &s->time_dt));
  PetscCall(StateReals(state, "position", n, s->x));
  PetscCall(StateReals(state, "position_old", n, s->x_old));
  PetscCall(StateReals(state, "velocity", n, s->u));
  PetscCall(StateReals(state, "velocity_old", n, s->u_old));
  PetscCall(StateHas(state, "tension", &has));
  if (has && SolidsCountGlobalAreas(solids)) PetscCall(StateReals(state, "tension", s->n, s->tension));
  PetscFunctionReturn(PETSC_SUCCESS);
}
