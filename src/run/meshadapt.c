/* Meshadapt: see meshadapt.h. */
#include "compat.h"
#include "meshadapt.h"
#include "base/log.h"
#include "base/opt.h"
#include "mesh/mark.h"

#define NEAR 6   /* cells of a surface's size: closer to it a cell is not halved alone */
#define NTRY 4   /* halvings of the share before a mesh counts as too large */
#define MORE 1.1 /* a mesh of less than so many times the unknowns is not worth solving on */

typedef enum {
  ALONE,
  TOGETHER, /* with all others at surfaces */
  NOT
} Refinement;

struct _p_MeshAdapt {
  MPI_Comm         comm;
  Refine           refine;
  Flow             flow;
  Couple           couple;
  Contact          contact;
  Monitor          monitor;
  Mesh             mesh;
  const MeshLocal *loc;
  MeshSurface      surface;
  PetscInt         levels, unknowns_max, round; /* unknowns_max: -mesh_adapt_unknowns, 0: any */
  PetscReal        tolerance, fraction, finest, relative;
  PetscReal       *eta; /* [ncell] */
  PetscInt         column;
};

PetscErrorCode MeshAdaptCreate(Refine refine, PetscBool steady, Flow flow, Couple couple, Bodies bodies,
                               Contact contact, Monitor monitor, MeshAdapt *adapt)
{
  const char *const     column[3] = {"cells", "unknowns", "error_indicator"};
  MeshAdapt             a;
  const FlowParameters *par;
  PetscBool             wanted, with_surfaces, still;
  PetscInt              levels;

  PetscFunctionBeginUser;
  *adapt = NULL;
  PetscCall(RefineIsByFlow(&wanted));
  if (!wanted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshReadLevels(&levels, &with_surfaces));
  PetscCheck(steady, MonitorComm(monitor), PETSC_ERR_USER_INPUT,
             "-mesh_adapt refines for a steady state: give -sim_steady, or -mesh_track for bodies that move, or remove it");
  PetscCheck(levels, MonitorComm(monitor), PETSC_ERR_USER_INPUT,
             "-mesh_adapt halves cells: give -mesh_levels, how often it may, or remove it");
  PetscCall(BodiesAreStill(bodies, &still));
  PetscCheck(still, MonitorComm(monitor), PETSC_ERR_SUP,
             "-mesh_adapt refines around bodies that stand still, and some are free to move: hold them (-particle_<group>_free none), or remove it");
  PetscCall(FlowGetParameters(flow, &par));
  PetscCheck(!FlowHasSymmetricStress(flow), MonitorComm(monitor), PETSC_ERR_SUP,
             "-mesh_adapt estimates the error of flows with one viscosity: remove -flow_rheology, or refine by -mesh_refine");
  PetscCheck(par->viscosity > 0, MonitorComm(monitor), PETSC_ERR_USER_INPUT,
             "-mesh_adapt needs viscosity: give -flow_viscosity, or remove -mesh_adapt");
  PetscCall(PetscNew(&a));
  a->comm     = MonitorComm(monitor);
  a->refine   = refine;
  a->flow     = flow;
  a->couple   = couple;
  a->contact  = contact;
  a->monitor  = monitor;
  a->levels   = levels;
  a->fraction = 0.5;
  PetscCall(FlowGetMesh(flow, &a->mesh));
  PetscCall(MeshGetLocal(a->mesh, &a->loc));
  PetscCall(OptReal("-mesh_adapt_tolerance", &a->tolerance));
  PetscCall(OptInt("-mesh_adapt_unknowns", &a->unknowns_max));
  PetscCall(OptReal("-mesh_adapt_fraction", &a->fraction));
  PetscCheck(a->tolerance > 0 || a->unknowns_max > 0, a->comm, PETSC_ERR_USER_INPUT,
             "-mesh_adapt has no end: give -mesh_adapt_tolerance or -mesh_adapt_unknowns");
  PetscCall(MeshReadFinest(a->comm, &a->finest));
  PetscCall(RefineGetSurface(refine, &a->surface));
  for (PetscInt i = 0; i < 3; i++) {
    PetscInt at;

    PetscCall(MonitorAddColumn(monitor, column[i], &at));
    if (i == 0) a->column = at;
  }
  *adapt = a;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshAdaptDestroy(MeshAdapt *adapt)
{
  PetscFunctionBeginUser;
  if (!*adapt) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*adapt)->eta));
  PetscCall(PetscFree(*adapt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshAdaptView(MeshAdapt a, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (!a) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscViewerASCIIPrintf(viewer, "mesh: refined by the flow, share %g of the error a round, until",
                                   (double)a->fraction));
  if (a->tolerance > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, " the indicator is below %g%s", (double)a->tolerance,
                                     a->unknowns_max ? " or" : ""));
  if (a->unknowns_max)
    PetscCall(PetscViewerASCIIPrintf(viewer, " more than %" PetscInt_FMT " unknowns follow", a->unknowns_max));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshAdaptEstimate(MeshAdapt a, PetscInt unknowns, const PetscReal *eta[])
{
  PetscBool *fluid;

  PetscFunctionBeginUser;
  *eta = NULL;
  if (!a) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(a->loc->ncell, &fluid));
  PetscCall(PetscFree(a->eta));
  PetscCall(PetscMalloc1(a->loc->ncell, &a->eta));
  PetscCall(CoupleMarkFluid(a->couple, fluid));
  PetscCall(FlowEstimate(a->flow, fluid, a->eta, &a->relative));
  PetscCall(PetscFree(fluid));
  a->round++;
  PetscCall(PetscPrintf(a->comm,
                        "  mesh %" PetscInt_FMT ": %" PetscInt_FMT " cells, %" PetscInt_FMT
                        " unknowns, error indicator %.3e\n",
                        a->round, a->loc->ncell_global, unknowns, (double)a->relative));
  PetscCall(MonitorSetColumn(a->monitor, a->column, (PetscReal)a->loc->ncell_global));
  PetscCall(MonitorSetColumn(a->monitor, a->column + 1, (PetscReal)unknowns));
  PetscCall(MonitorSetColumn(a->monitor, a->column + 2, a->relative));
  PetscCall(MonitorQuantity(a->monitor, "error_indicator", a->relative));
  *eta = a->eta;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- which cells ---- */

/* Closer to a surface a cell is not halved alone */
static PetscReal near_surface(MeshAdapt a)
{
  return NEAR * a->finest * (PetscReal)((PetscInt)1 << a->surface.coarser);
}

/* Is own cell c one of those at a surface, all of which are of one size? */
static PetscErrorCode is_at_surface(MeshAdapt a, PetscInt c, PetscInt level, PetscBool *at)
{
  const MeshLocal *l    = a->loc;
  const PetscReal  near = near_surface(a);
  PetscReal        d = PETSC_MAX_REAL, x[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  *at = PETSC_FALSE;
  if (!a->surface.distance || level < a->levels - a->surface.coarser) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < l->dim; i++) x[i] = l->x[l->cell_node[c * l->nb + l->nb / 2] * l->dim + i];
  PetscCall((*a->surface.distance)(a->surface.context, x, near, &d));
  *at = (PetscBool)(d < near);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Before own cells ask how far they are from the surface */
static PetscErrorCode look_here(MeshAdapt a)
{
  RankBoxes regions;
  PetscReal beyond;

  PetscFunctionBeginUser;
  PetscCall(MeshCreateRankBoxes(a->mesh, 0, &regions, &beyond));
  PetscCall((*a->surface.look)(a->surface.context, regions, near_surface(a)));
  PetscCall(RankBoxesDestroy(&regions));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How own cells can be halved: [ncell] */
static PetscErrorCode sort_cells(MeshAdapt a, Refinement refinement[])
{
  PetscFunctionBeginUser;
  if (a->surface.look) PetscCall(look_here(a));
  for (PetscInt c = 0; c < a->loc->ncell; c++) {
    PetscInt  level;
    PetscBool at;

    PetscCall(MeshGetLevel(a->mesh, c, &level));
    PetscCall(is_at_surface(a, c, level, &at));
    if (at) refinement[c] = a->surface.coarser > 0 ? TOGETHER : NOT;
    else refinement[c] = level < a->levels ? ALONE : NOT;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sum of the squares of those above a bound */
static PetscErrorCode sum_above(MeshAdapt a, const Refinement refinement[], PetscReal bound, PetscReal *sum)
{
  PetscFunctionBeginUser;
  *sum = 0;
  for (PetscInt c = 0; c < a->loc->ncell; c++)
    if (refinement[c] != NOT && a->eta[c] > bound) *sum += PetscSqr(a->eta[c]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 1, MPIU_REAL, MPIU_SUM, a->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The largest bound above which a share of the sum of squares lies, of cells that can be halved */
static PetscErrorCode find_bound(MeshAdapt a, const Refinement refinement[], PetscReal fraction, PetscReal *bound)
{
  PetscReal low = 0, high = 0, all, sum;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < a->loc->ncell; c++) high = PetscMax(high, a->eta[c]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &high, 1, MPIU_REAL, MPIU_MAX, a->comm));
  PetscCall(sum_above(a, refinement, 0, &all));
  for (PetscInt i = 0; i < 40; i++) {
    const PetscReal middle = 0.5 * (low + high);

    PetscCall(sum_above(a, refinement, middle, &sum));
    if (sum >= fraction * all) low = middle;
    else high = middle;
  }
  *bound = low;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells with an error above the bound. Those at surfaces are halved together: where the mesh is lined up with these if
   the root of their mean square is above it, else, because cut cells count for nothing in the estimate, if that of one
   of them is; or if nothing else is left (runs/studies/refinement). *coarser: levels less than all there. *any: is
   there something to halve? */
static PetscErrorCode mark_cells(MeshAdapt a, const Refinement refinement[], PetscReal bound, PetscBool mark[],
                                 PetscInt *coarser, PetscBool *any)
{
  PetscReal sum[4] = {0, 0, 0, 0}; /* cells marked; at surfaces: above the bound, all, sum of squares */
  PetscBool lined_up;

  PetscFunctionBeginUser;
  PetscCall(CoupleIsLinedUp(a->couple, &lined_up));
  for (PetscInt c = 0; c < a->loc->ncell; c++) {
    mark[c] = (PetscBool)(refinement[c] == ALONE && a->eta[c] > bound);
    sum[0] += mark[c];
    if (refinement[c] != TOGETHER || a->eta[c] == 0) continue;
    sum[1] += a->eta[c] > bound;
    sum[2]++;
    sum[3] += PetscSqr(a->eta[c]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, a->comm));
  *coarser = a->surface.coarser;
  if (sum[1] > 0 && (!lined_up || sum[3] > sum[2] * PetscSqr(bound) || sum[0] == 0)) (*coarser)--;
  *any = (PetscBool)(sum[0] > 0 || *coarser < a->surface.coarser);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the next mesh ---- */

static PetscInt count_unknowns(const MeshLocal *l)
{
  return l->dim * l->nnode_global + (l->dim + 1) * l->ncell_global;
}

/* *now: the mesh with the cells that make this share of the error halved, NULL if none can be; *coarser as there */
static PetscErrorCode try_fraction(MeshAdapt a, const Refinement refinement[], PetscReal fraction, PetscInt *coarser,
                                   Mesh *now)
{
  PetscReal   bound   = 0;
  MeshSurface surface = a->surface;
  MeshMarks   marks;
  PetscBool  *mark, any = PETSC_FALSE;

  PetscFunctionBeginUser;
  *now = NULL;
  PetscCall(PetscMalloc1(a->loc->ncell, &mark));
  PetscCall(find_bound(a, refinement, fraction, &bound));
  PetscCall(mark_cells(a, refinement, bound, mark, &surface.coarser, &any));
  if (any) {
    PetscCall(MeshMarksGrow(a->mesh, mark, &marks));
    surface.marks = marks;
    PetscCall(MeshCreateAround(a->comm, &surface, now));
    PetscCall(MeshMarksDestroy(&marks));
  }
  *coarser = surface.coarser;
  PetscCall(PetscFree(mark));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The largest share that leaves the unknowns within their limit; *now NULL: none does, or all cells are as small as
   -mesh_levels allows */
static PetscErrorCode make_mesh(MeshAdapt a, Mesh *now)
{
  PetscReal   fraction = a->fraction;
  PetscBool   full     = PETSC_FALSE;
  PetscInt    coarser  = a->surface.coarser;
  Refinement *refinement;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(a->loc->ncell, &refinement));
  PetscCall(sort_cells(a, refinement));
  for (PetscInt i = 0; i < NTRY; i++, fraction *= 0.5) {
    const MeshLocal *l;

    PetscCall(try_fraction(a, refinement, fraction, &coarser, now));
    if (!*now) break;
    PetscCall(MeshGetLocal(*now, &l));
    full = (PetscBool)(full || (a->unknowns_max > 0 && count_unknowns(l) > a->unknowns_max));
    if (!full || (count_unknowns(l) <= a->unknowns_max && count_unknowns(l) > MORE * count_unknowns(a->loc))) break;
    PetscCall(MeshDestroy(now));
  }
  PetscCall(PetscFree(refinement));
  if (!*now && !full)
    PetscCall(LogRemark("-mesh_adapt ends before its target: all cells with errors have been halved %" PetscInt_FMT
                        " times. Raise -mesh_levels",
                        a->levels));
  if (!*now) PetscFunctionReturn(PETSC_SUCCESS);
  a->surface.coarser = coarser;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshAdaptRefine(MeshAdapt a, Steady steady, PetscBool *more)
{
  Mesh now;

  PetscFunctionBeginUser;
  *more = PETSC_FALSE;
  if (!a || a->relative <= a->tolerance) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(make_mesh(a, &now));
  if (!now) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(RefineReplace(a->refine, now));
  PetscCall(ContactMigrate(a->contact, 0, NULL));
  PetscCall(CoupleUpdateLocalBodies(a->couple));
  PetscCall(SteadyRemesh(steady));
  *more = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}
