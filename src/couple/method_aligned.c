/* Boundary method aligned: the mesh lines up with the bodies (align/align.h), whose inside is no part of the fluid.
   A body that it cannot follow is held by the penalty in that step; one thinner than a cell is a path of edges: the
   fluid that it displaces is there and moves with it, so that its rigid rows are those of method nodal.

   Columns of series.csv: aligned_penalty_bodies, bodies held by the penalty; aligned_narrow_gaps, bodies whose walls
   are drawn back in narrow gaps; aligned_extrapolated, nodes whose old values came from Taylor's formula;
   aligned_unchanged, nodes for which there was none (remap.h); aligned_cut_corners, corners of bodies that the mesh
   cuts off, in space its vertices off their edges. */
#include "compat.h"
#include "impl.h"
#include "penalty.h"
#include "alignbodies.h"
#include "couple/bodysurfaces.h"
#include "base/log.h"
#include "bodies/local.h"

#define FAR 0.5 /* cells that a body may go in a step (runs/studies/tradeoff) */

enum {
  FALLBACK,
  NARROW,
  TAYLOR,
  KEPT,
  CORNERS,
  NCOUNT
};

typedef struct {
  AlignBodies align;
  Penalty     penalty;
  PetscBool   remarked;  /* that a body goes too far in a step */
  PetscBool   cut;       /* likewise, that the mesh cuts corners off */
  PetscBool   penalised; /* likewise, that the penalty holds a body */
} AlignedMethod;

typedef struct {
  AlignBodiesKept *align;
  PetscBool        remarked, cut, penalised;
} MethodKept;

static PetscErrorCode create_aligned(Couple c, void **method)
{
  AlignedMethod *r;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&r));
  PetscCall(PenaltyCreate(c->flow, c->bodies, &r->penalty));
  PetscCall(AlignBodiesCreate(c->flow, c->bodies, c->mesh_update, &r->align));
  c->method.count[FALLBACK]     = (CoupleCount){.name = "aligned_penalty_bodies", .summed = PETSC_TRUE};
  c->method.count[NARROW].name  = "aligned_narrow_gaps";
  c->method.count[TAYLOR].name  = "aligned_extrapolated";
  c->method.count[KEPT].name    = "aligned_unchanged";
  c->method.count[CORNERS].name = "aligned_cut_corners";
  c->method.ncount              = NCOUNT;
  c->method.bound               = (CoupleBound){.name     = "aligned_displacement",
                                                .what     = "the displacement of bodies with -couple_method aligned",
                                                .option   = "-sim_dt",
                                                .unit     = "cells",
                                                .then     = "a remark: accuracy is lost",
                                                .value    = FAR,
                                                .exceeded = c->method.bound.exceeded};
  *method                       = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The group of the body with that permanent number */
static const char *group_of(BodyState *s, PetscReal number)
{
  PetscInt g = 0;

  while (s->group[g].first + s->group[g].count <= number) g++;
  return s->group[g].name;
}

/* That the mesh does not follow this body, once */
static PetscErrorCode remark_penalty(Couple c, AlignedMethod *r, PetscReal number)
{
  PetscFunctionBeginUser;
  if (r->penalised || number == PETSC_MAX_REAL) PetscFunctionReturn(PETSC_SUCCESS);
  r->penalised = PETSC_TRUE;
  PetscCall(
    LogRemark("-couple_method aligned cannot follow body %" PetscInt_FMT
              " (group '%s') at t = %g, and the penalty holds it until it could be followed for some steps (column aligned_penalty_bodies of series.csv, steps in the "
              "summary): less accurate. The cells are too large for it, or it "
              "ends at a side of the domain: refine the mesh, or let the body end a cell before or more than a cell beyond the side",
              (PetscInt)number, group_of(c->s, number), (double)c->step->time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that the penalty holds, and the first of them */
static PetscErrorCode count_penalty(Couple c, const PetscBool aligned[], PetscReal *count, PetscReal *first)
{
  PetscFunctionBeginUser;
  *count = 0;
  *first = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (aligned[k] || c->s->removed[k] || BodiesGetGroup(c->s, k)->body_fitted || !c->s->own[k]) continue;
    (*count)++;
    *first = PetscMin(*first, (PetscReal)c->s->number[k]);
  }
  PetscCall(BodiesSum(c->bodies, 1, count));
  PetscCall(BodiesMin(c->bodies, 1, first));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_aligned(Couple c, void *method, const PenaltyTerm **terms)
{
  AlignedMethod     *r      = (AlignedMethod *)method;
  const PetscInt     before = c->method.count[FALLBACK].value;
  const AlignResult *s;
  const RemapCount  *remap;
  const PetscBool   *aligned;
  PetscReal          penalised, first;

  PetscFunctionBeginUser;
  PetscCall(AlignBodiesUpdate(r->align, c->rigid.X, c->rigid.q, &aligned));
  PetscCall(AlignDriverGetResult(AlignBodiesGetDriver(r->align), &s, &remap));
  c->method.inactive_inside = s->inactive;
  c->method.on_surface      = s->on_wall;
  c->method.sides_move      = (PetscBool)(c->method.sides_move || s->npass);
  for (PetscInt e = 0; e < s->nmarked; e++)
    if (s->node_surface[s->marked[e]] < c->s->n) /* those of others come after the bodies */
      PetscCall(IndicatorAssign(c->indicator, s->marked[e], s->node_surface[s->marked[e]]));
  c->method.count[NARROW].value  = s->nnarrow;
  c->method.count[CORNERS].value = s->ncut;
  c->method.count[TAYLOR].value += remap->taylor;
  c->method.count[KEPT].value += remap->kept;
  PetscCall(count_penalty(c, aligned, &penalised, &first));
  PetscCall(remark_penalty(c, r, first));
  c->method.count[FALLBACK].value = (PetscInt)penalised;
  *terms                          = NULL;
  if (!c->method.count[FALLBACK].value && !before) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PenaltyUpdateGeometry(r->penalty, c->rigid.X, c->rigid.q, c->rigid.P, aligned, c->indicator));
  PetscCall(PenaltyGetTerm(r->penalty, terms));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode stiffen_aligned(void *method, PetscBool *changed)
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyStiffen(((AlignedMethod *)method)->penalty, changed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_force(Couple c, void *method, const unsigned char fixed[], PetscReal out[3])
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyAddPrescribed(((AlignedMethod *)method)->penalty, fixed, c->field.u, c->rigid.U, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static Penalty get_penalty(void *method)
{
  return ((AlignedMethod *)method)->penalty;
}

/* That the mesh cuts corners off, once */
static PetscErrorCode remark_corners(Couple c, AlignedMethod *r)
{
  PetscFunctionBeginUser;
  if (!c->method.count[CORNERS].value || r->cut) PetscFunctionReturn(PETSC_SUCCESS);
  r->cut = PETSC_TRUE;
  PetscCall(LogRemark("-couple_method aligned %s at %" PetscInt_FMT
                      " places at t = %g (column aligned_cut_corners of series.csv): %s",
                      c->loc->dim == 3 ? "cuts edges of bodies off" : "cuts corners of bodies off",
                      c->method.count[CORNERS].value, (double)c->step->time,
                      "forces on such a body depend more on the mesh; refine it there, or round the corners"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells that body k goes in this step */
static PetscReal displacement_of(Couple c, PetscInt k)
{
  return BodiesFastestPoint(c->s, k, 0) * c->step->dt / c->loc->h;
}

/* The first body that goes farther than FAR: *mine on this rank, -1: none, *number over all, PETSC_MAX_REAL: none */
static PetscErrorCode find_far(Couple c, PetscInt *mine, PetscReal *number)
{
  const BodyState *s = c->s;

  PetscFunctionBeginUser;
  *mine = -1;
  for (PetscInt k = 0; k < s->n && *mine < 0; k++) /* by their numbers */
    if (!s->removed[k] && displacement_of(c, k) > FAR) *mine = k;
  *number = *mine < 0 ? PETSC_MAX_REAL : (PetscReal)s->number[*mine];
  PetscCall(BodiesMin(c->bodies, 1, number));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The fields are carried to the nodes that move; where a body goes more than half a cell in a step that costs
   accuracy: a row of the table of limits counts such steps, and the first is remarked */
static PetscErrorCode accept_step(Couple c, void *method)
{
  AlignedMethod *r = (AlignedMethod *)method;
  PetscReal      far, displacement = 0;
  PetscInt       mine;

  PetscFunctionBeginUser;
  c->method.count[TAYLOR].value = c->method.count[KEPT].value = 0;
  PetscCall(remark_corners(c, r));
  PetscCall(find_far(c, &mine, &far));
  if (far == PETSC_MAX_REAL) PetscFunctionReturn(PETSC_SUCCESS);
  c->method.bound.exceeded++;
  if (r->remarked) PetscFunctionReturn(PETSC_SUCCESS);
  r->remarked = PETSC_TRUE;
  if (mine >= 0 && c->s->number[mine] == far)
    displacement = displacement_of(c, mine); /* the same on all ranks that know it */
  PetscCall(BodiesMax(c->bodies, 1, &displacement));
  PetscCall(
    LogRemark("body %" PetscInt_FMT
              " (group '%s') goes %.2g of the smallest cells in the step to t = %g; -couple_method aligned loses accuracy beyond 0.5: lower -sim_dt (%g), or "
              "use -sim_adapt",
              (PetscInt)far, group_of(c->s, far), (double)displacement, (double)c->step->time, (double)c->step->dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_carry(void *method, AlignCarry carry, void *ctx)
{
  PetscFunctionBeginUser;
  PetscCall(AlignBodiesSetCarry(((AlignedMethod *)method)->align, carry, ctx));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static AlignDriver get_driver(void *method)
{
  return AlignBodiesGetDriver(((AlignedMethod *)method)->align);
}

static PetscErrorCode set_points(void *method, PetscInt n, const PetscReal x[])
{
  PetscFunctionBeginUser;
  PetscCall(AlignBodiesSetPoints(((AlignedMethod *)method)->align, n, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_state(void *method, State state)
{
  PetscFunctionBeginUser;
  PetscCall(AlignBodiesVisitState(((AlignedMethod *)method)->align, state));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode keep_of_mesh(void *method, void **left)
{
  AlignedMethod *r = (AlignedMethod *)method;
  MethodKept    *l;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&l));
  l->remarked  = r->remarked;
  l->cut       = r->cut;
  l->penalised = r->penalised;
  PetscCall(AlignBodiesBeforeRemesh(r->align, &l->align));
  *left = l;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_on_mesh(void *method, void **left, Mesh *old)
{
  AlignedMethod *r = (AlignedMethod *)method;
  MethodKept    *l = (MethodKept *)*left;

  PetscFunctionBeginUser;
  r->remarked  = l->remarked;
  r->cut       = l->cut;
  r->penalised = l->penalised;
  PetscCall(AlignBodiesAfterRemesh(r->align, &l->align, old));
  PetscCall(PetscFree(*left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_aligned(void *method, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PenaltyView(((AlignedMethod *)method)->penalty, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_aligned(void *method)
{
  AlignedMethod *r = (AlignedMethod *)method;

  PetscFunctionBeginUser;
  PetscCall(AlignBodiesDestroy(&r->align));
  PetscCall(PenaltyDestroy(&r->penalty));
  PetscCall(PetscFree(r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const BoundaryMethod method_aligned = {.name          = "aligned",
                                       .moves_nodes   = PETSC_TRUE,
                                       .reach         = ALIGN_RINGS + 2,
                                       .spread        = BodySurfacesSpreadThin,
                                       .create        = create_aligned,
                                       .update        = update_aligned,
                                       .stiffen       = stiffen_aligned,
                                       .force         = add_force,
                                       .penalty       = get_penalty,
                                       .carry         = set_carry,
                                       .driver        = get_driver,
                                       .points        = set_points,
                                       .before_remesh = keep_of_mesh,
                                       .after_remesh  = make_on_mesh,
                                       .accept        = accept_step,
                                       .state         = visit_state,
                                       .view          = view_aligned,
                                       .destroy       = destroy_aligned};
