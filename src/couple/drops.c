/* CoupleDrops: see drops.h; the participant. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "scalarphases.h"
#include "base/opt.h"
#include "couple/participant.h"
#include <strings.h>

#define ROUND  1e-12 /* of what the fluid around weighs: sums of what drops weigh more are off by less */
#define CLOSED (-2)  /* in a checkpoint, for the number of its drop: a cell that is closed */

/* ---- life cycle ---- */

static PetscErrorCode discard(Couple c, void *data)
{
  CoupleDrops *f = (CoupleDrops *)data;

  PetscFunctionBeginUser;
  (void)c;
  PetscCall(AlignDestroy(&f->align));
  PetscCall(RemapDestroy(&f->remap));
  PetscCall(PetscFree3(f->cell_drop, f->density, f->viscosity));
  PetscCall(PetscFree6(f->way, f->corr, f->shift, f->velocity, f->force, f->weight));
  PetscCall(PetscFree2(f->side, f->wall));
  PetscCall(PetscFree(f->closed));
  PetscCall(PetscFree(f->load));
  PetscCall(PetscFree2(f->fraction, f->by_middle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_on_mesh(Couple c, void *data, Mesh *old)
{
  CoupleDrops   *f = (CoupleDrops *)data;
  const PetscInt n = c->loc->dim * c->loc->nnode_all, ncell = c->loc->ncell_all;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(ncell, &f->cell_drop, ncell, &f->density, ncell, &f->viscosity));
  PetscCall(
    PetscCalloc6(n, &f->way, n, &f->corr, n, &f->shift, n, &f->velocity, n, &f->force, n / c->loc->dim, &f->weight));
  for (PetscInt e = 0; e < ncell; e++) f->cell_drop[e] = -1;
  if (DropsWet(f->s)) PetscCall(PetscCalloc2(c->loc->nnode_all, &f->side, 6, &f->wall));
  PetscCall(DropsFindWalls(f, c));
  if (c->s->nall || DropsMayStayApart(f->s)) PetscCall(PetscCalloc1(PetscMax(1, c->loc->ncell), &f->closed));
  if (f->meets) PetscCall(PetscMalloc1(n, &f->load));
  if (f->meets || f->regular) PetscCall(PetscMalloc2(ncell, &f->fraction, ncell, &f->by_middle));
  for (PetscInt e = 0; e < ncell && f->fraction; e++) {
    f->fraction[e]  = 1;
    f->by_middle[e] = -1;
  }
  PetscCall(PhaseSurfacesSetClosed(f->surfaces, f->closed));
  PetscCall(DropsSetFilm(f, c));
  PetscCall(DropsFindLongest(f, c));
  f->s->cell_drop = f->regular ? f->by_middle : f->cell_drop;
  PetscCall(PhaseSurfacesSet(f->surfaces, &f->interface));
  if (!f->regular) PetscCall(AlignCreate(c->mesh, PhaseSurfacesGet(f->surfaces), &f->align));
  PetscCall(RemapCreate(c->mesh, &f->remap));
  if (old) PetscCall(DropsArrive(f, c, old));
  PetscCall(DropsSetProperties(f, c)); /* the solver is to know that there are viscosities */
  PetscCall(CoupleRenewSolver(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode keep_of_mesh(Couple c, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(DropsKeepMesh((CoupleDrops *)data, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  CoupleDrops *f = (CoupleDrops *)data;

  PetscFunctionBeginUser;
  PetscCall(discard(c, data));
  PetscCall(BodiesDetach(c->bodies, (void **)&f->weight_of_bodies));
  PetscCall(PhaseInterfaceDestroy(&f->interface));
  PetscCall(PhaseSurfacesDestroy(&f->surfaces));
  PetscCall(PetscFree(f->term_cell));
  PetscCall(PetscFree(f->term));
  PetscCall(PetscFree(f->band_cell));
  PetscCall(PetscFree(f->band));
  PetscCall(PetscFree(f->angle));
  PetscCall(PetscFree(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the step ---- */

static PetscErrorCode predict(Couple c, void *data)
{
  CoupleDrops *f = (CoupleDrops *)data;

  PetscFunctionBeginUser;
  PetscCheck(c->step->dt > 0 && c->step->theta == 1, c->comm, PETSC_ERR_SUP,
             "Drops move in time steps of -flow_time be or bdf2: choose one of them, without -sim_steady");
  c->method.others = PETSC_TRUE; /* cells that bodies cut are others, though these may be still */
  if (c->sets_up && f->lined_up) {
    PetscCall(PetscArrayzero(f->velocity, c->loc->dim * c->loc->nnode_all));
    PetscCall(FlowSetMeshVelocity(c->flow, f->velocity));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(DropsPredict(f, c));
  if (f->regular) {
    PetscCall(DropsRegularise(f, c));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(DropsCloseCells(f, c));
  PetscCall(DropsKeepApart(f, c));
  PetscCall(DropsAlign(f, c)); /* before other participants look at the mesh */
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_bodies(Couple c, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(DropsTakeBodies((CoupleDrops *)data, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assemble(Couple c, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(DropsAssemble((CoupleDrops *)data, c));
  PetscCall(DropsLoadBodies((CoupleDrops *)data, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Surface energy; the weight in excess of the fluid around */
static PetscErrorCode add_energy(Couple c, void *data, CouplePower *w)
{
  CoupleDrops *f = (CoupleDrops *)data;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < f->s->n; k++) {
    const Drop      *d = f->s->drop + k;
    const DropGroup *g = f->s->group + d->group;

    w->energy += DropSurfaceEnergy(g, &d->sums);
    for (PetscInt a = 0; a < c->loc->dim; a++)
      w->power += (g->density - c->par->density) * c->par->gravity[a] * d->flux[a];
  }
  PetscCall(DropsAddEnergyOfBodies(f, c, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_forces(Couple c, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(DropsAddForces((CoupleDrops *)data, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_losses(Couple c, void *data, CoupleLosses *w)
{
  PetscFunctionBeginUser;
  PetscCall(DropsAddLosses((CoupleDrops *)data, c, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode balance(Couple c, void *data, const FlowDiagnostics *d, CoupleBalance *b)
{
  const CoupleDrops *f      = (const CoupleDrops *)data;
  const PetscInt     dim    = c->loc->dim;
  PetscReal          sum[3] = {0}, gravity = 0;

  PetscFunctionBeginUser;
  (void)d;
  for (PetscInt a = 0; a < dim; a++) gravity += PetscSqr(c->par->gravity[a]);
  PetscCall(DropsBalanceWalls(f, c, c->field.u, sum));
  for (PetscInt k = 0; k < f->s->n; k++) {
    const Drop      *drop = f->s->drop + k;
    const DropGroup *g    = f->s->group + drop->group;
    const PetscReal  more = g->density - c->par->density;

    /* the pull across a cut through the middle, about: at two points, in space along a line */
    b->size += g->tension * (dim == 2 ? 2 : PetscSqrtReal(PETSC_PI * drop->sums.length)) +
               (PetscAbsReal(more) + ROUND * c->par->density) * PetscAbsReal(drop->sums.area) * PetscSqrtReal(gravity);
  }
  for (PetscInt a = 0; a < dim; a++) {
    b->walls[a] += sum[a];
    b->residual[a] -= sum[a];
    b->size += PetscAbsReal(sum[a]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode limit(Couple c, void *data, PetscReal *dt)
{
  PetscFunctionBeginUser;
  PetscCall(DropsLimitStep((CoupleDrops *)data, c, dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solved(Couple c, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(DropsAccept((CoupleDrops *)data, c, c->field.u));
  PetscCall(DropsCheckVolumes((CoupleDrops *)data, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit(Couple c, void *data, State state)
{
  CoupleDrops   *f   = (CoupleDrops *)data;
  const PetscInt dim = c->loc->dim, nb = c->loc->nb;
  PetscReal     *drop, *u;
  PetscInt       first = f->first_order, lined_up = f->lined_up;

  PetscFunctionBeginUser;
  PetscCall(DropsVisitState(f->drops, state));
  PetscCall(DropsVisitBodies(f, state));
  PetscCall(PhaseInterfaceVisit(state, dim, &f->interface));
  PetscCall(StateInts(state, "drops_first_order", 1, &first));
  PetscCall(StateInts(state, "drops_lined_up", 1, &lined_up));
  f->first_order = (PetscBool)first;
  f->lined_up    = (PetscBool)lined_up;
  PetscCall(StateNodes(state, "drops_correction", dim, f->corr));
  PetscCall(StateNodes(state, "drops_shift", dim, f->shift));
  PetscCall(PetscMalloc1(c->loc->nnode_all, &drop));
  for (PetscInt i = 0; i < c->loc->nnode_all; i++) drop[i] = -1;
  for (PetscInt e = 0; e < c->loc->ncell_all; e++)
    drop[c->loc->cell_node[e * nb + nb / 2]] = f->closed && e < c->loc->ncell && f->closed[e]
                                               ? CLOSED
                                               : (PetscReal)f->cell_drop[e];
  PetscCall(StateNodes(state, "drops_cells", 1, drop)); /* at the middle of the cells, ghosts too */
  if (StateIsLoading(state) && f->lined_up) {
    for (PetscInt e = 0; e < c->loc->ncell_all; e++) {
      const PetscReal value = drop[c->loc->cell_node[e * nb + nb / 2]];

      f->cell_drop[e] = (PetscInt)PetscMax(-1, value);
      if (f->closed && e < c->loc->ncell) f->closed[e] = (PetscBool)(value == CLOSED);
    }
    if (f->regular) PetscCall(DropsFindFractions(f, c));
    else {
      PetscCall(DropsLineUp(f, c));
      PetscCall(DropsPlaceNodes(f, c));
    }
    PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
    PetscCall(DropsMeasure(f, c, u));
    PetscCall(DropsSetProperties(f, c));
    PetscCall(CoupleNeedsSolver(c));
  }
  PetscCall(PetscFree(drop));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(Couple c, void *data, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  (void)c;
  PetscCall(DropsView(((CoupleDrops *)data)->drops, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant DROPS = {.name          = "drops",
                                        .begin         = predict,
                                        .prepare       = take_bodies,
                                        .rows          = assemble,
                                        .solved        = solved,
                                        .force         = add_forces,
                                        .balance       = balance,
                                        .energy        = add_energy,
                                        .losses        = add_losses,
                                        .limit         = limit,
                                        .before_remesh = keep_of_mesh,
                                        .discard       = discard,
                                        .after_remesh  = make_on_mesh,
                                        .visit         = visit,
                                        .view          = view,
                                        .destroy       = destroy};

/* Scalars know the groups as materials */
static PetscErrorCode add_phases(const CoupleDrops *f, Couple c)
{
  ScalarPhase *phase;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(f->s->ngroups, &phase));
  for (PetscInt g = 0; g < f->s->ngroups; g++)
    phase[g] = (ScalarPhase){.name = f->s->group[g].name, .density = f->s->group[g].density};
  PetscCall(CoupleAddPhases(c, f->s->ngroups, phase));
  PetscCall(PetscFree(phase));
  for (PetscInt g = 0; g < f->s->ngroups; g++) {
    PetscInt like = 0;

    while (!CouplePhasesAreAlike(c, like, g)) like++;
    DropsSetCarried(f->drops, g, like);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solvers that solve for what tension does to a step */
static PetscErrorCode check_solver(Couple c, const DropsState *s)
{
  char kind[32];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-flow_solver", kind, sizeof(kind)));
  for (PetscInt g = 0; g < s->ngroups; g++)
    PetscCheck(s->group[g].tension == 0 || strcmp(kind, "fast") != 0, c->comm, PETSC_ERR_SUP,
               "-flow_solver fast leaves too much of the surface tension of '%s' (drops at rest break up): use -flow_solver balanced, accurate or "
               "direct",
               s->group[g].name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleSetDrops(Couple c, Drops drops)
{
  static const char *const FORMS[] = {"aligned", "regularised", NULL};
  const BoundaryMethod    *method;
  CoupleDrops             *f;
  PetscInt                 form = 0;
  PetscBool                given, tracks = PETSC_FALSE;
  char                     adapt[16];
  PetscReal                size = 0;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-couple_drops", FORMS, &form));
  PetscCall(OptHas("-couple_method", &given));
  PetscCall(BoundaryMethodChoose(&method));
  PetscCheck(!given || method->moves_nodes || c->s->nall, c->comm, PETSC_ERR_SUP,
             "-couple_method %s: the mesh is lined up with drops: use aligned, or remove the option (-couple_drops regularised: drops without)",
             method->name);
  PetscCheck(!c->s->nall || method == &method_penalty, c->comm, PETSC_ERR_SUP,
             "-couple_method %s: the mesh is lined up with drops, and rigid bodies beside them are held by the penalty: give -couple_method "
             "penalty",
             method->name);
  PetscCheck(c->par->convection, c->comm, PETSC_ERR_SUP,
             "-flow_convection false: old velocities follow the drops, which the convection has to know: remove it");
  PetscCall(OptPeek("-sim_adapt", adapt, sizeof(adapt)));
  PetscCheck(!adapt[0] || !strcasecmp(adapt, "false"), c->comm, PETSC_ERR_SUP,
             "-sim_adapt %s: a step with drops cannot be taken again yet: remove it", adapt);
  PetscCheck(!c->elastic, c->comm, PETSC_ERR_SUP,
             "Drops next to elastic particles are not possible yet: give each its own scene");
  PetscCall(FlowAllowParabola(c->flow, PETSC_FALSE));
  PetscCall(PetscNew(&f));
  f->drops = drops;
  PetscCall(OptReal("-couple_drops_steps", &f->steps));
  PetscCall(DropsGetState(drops, &f->s));
  PetscCall(check_solver(c, f->s));
  PetscCall(DropsReadAngles(f, c));
  if (f->meets) PetscCall(BodiesAttachWork(c->bodies, sizeof(*f->weight_of_bodies), (void **)&f->weight_of_bodies));
  f->regular = (PetscBool)form;
  if (f->regular) PetscCall(DropsCheckRegular(f, c));
  PetscCall(add_phases(f, c));
  PetscCall(OptPeekBool("-mesh_track", &tracks));
  if (tracks) PetscCall(DropsCheckRemesh(f, c));
  for (PetscInt a = 0; a < c->loc->dim; a++) size += PetscSqr(c->loc->upper[a] - c->loc->lower[a]);
  PetscCall(PhaseSurfacesCreate(c->loc->dim, PetscSqrtReal(size), &f->surfaces));
  PetscCall(CoupleAddParticipant(c, &DROPS, f));
  PetscFunctionReturn(PETSC_SUCCESS);
}
