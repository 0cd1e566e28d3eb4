/* FlowRateControl: the uniform force on fluid and bodies that a scene does not give but asks for.

   -flow_rate holds the mean velocity along axes: the force is one more unknown of the linear system (FlowIntegral in
   solve/system.h). -couple_backflow says what the weight of bodies less their buoyancy, w, meets along periodic
   axes, where no bottom carries it: `none`, no force but -flow_force (walls and bodies that stand still carry w;
   without any, fluid and bodies are accelerated for ever); `flux`, the force that holds the mean velocity of fluid and
   bodies at zero; `force`, the force - sum w/volume, under which nothing accelerates fluid and bodies as a whole (the
   pressure gradient of a suspension at rest). In a box that is periodic along every axis `force` keeps the mean
   momentum, `flux` the mean velocity. */
#include "compat.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "impl.h"

enum {
  NONE,
  FLUX,
  FORCE
};
#define STUCK \
  "A uniform force does not move the fluid along the axes of -flow_rate, as far as the solver sees: lower -flow_ksp_rtol, or use -flow_solver direct"
static const char *const BACKFLOWS[] = {"none", "flux", "force", NULL};

struct _p_FlowRateControl {
  FlowRateResult out;
  PetscInt       backflow;
  PetscReal      force[3];               /* ours */
  PetscReal      rate[3], volume, fluid; /* volume: with bodies inside whom there is no fluid */
  PetscInt       n;                      /* integrals that are held, and the weights of rigid velocities in them */
  FlowIntegral   integral[3];
  PetscReal     *rigid[3];
};

/* Periodic axes along which gravity acts */
static PetscInt find_axes(Couple c)
{
  PetscInt axes = 0;

  for (PetscInt a = 0; a < c->loc->dim; a++)
    if (c->loc->period[a] > 0 && c->par->gravity[a] != 0) axes |= 1 << a;
  return axes;
}

static PetscErrorCode read_backflow(Couple c, PetscInt *backflow, PetscInt *axes)
{
  PetscFunctionBeginUser;
  *backflow = NONE;
  *axes     = 0;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptChoice("-couple_backflow", BACKFLOWS, backflow));
  if (*backflow == NONE) PetscFunctionReturn(PETSC_SUCCESS);
  *axes = find_axes(c);
  PetscCheck(*axes, c->comm, PETSC_ERR_USER_INPUT,
             "Option -couple_backflow %s: gravity acts along no periodic axis, and what closes the box holds the weight of the bodies: remove it, or "
             "make the axis of -flow_gravity periodic (-mesh_periodic)",
             BACKFLOWS[*backflow]);
  PetscCheck(*backflow == FLUX || c->implicit, c->comm, PETSC_ERR_USER_INPUT,
             "Option -couple_backflow force: explicit coupling hands the force on a step late, so that forces do not balance within a step: use "
             "-couple_type implicit, or -couple_backflow flux");
  for (PetscInt a = 0; a < c->loc->dim; a++)
    PetscCheck(!((*axes & c->par->rate_axes) >> a & 1), c->comm, PETSC_ERR_USER_INPUT,
               "Option -couple_backflow %s: -flow_rate holds the mean velocity along %c already (0: zero net flux): remove one of the two, or %c from -flow_rate_axes",
               BACKFLOWS[*backflow], (char)('x' + a), (char)('x' + a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  FlowRateControl d = (FlowRateControl)data;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 3; i++) PetscCall(BodiesDetach(c->bodies, (void **)&d->rigid[i]));
  PetscCall(PetscFree(c->flow_rate));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode connect_solver(Couple c, void *data, FlowSolver solver)
{
  FlowRateControl d = (FlowRateControl)data;

  PetscFunctionBeginUser;
  (void)c;
  if (d->n) PetscCall(FlowSolverAddIntegrals(solver, d->n, d->integral));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Volume of fluid and bodies (without those that are holes of the mesh), and rigid weights of bodies without fluid
   inside */
static PetscErrorCode evaluate_weights(Couple c, FlowRateControl d)
{
  const PetscReal *m;
  PetscReal        volume = 0, inactive;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(c->flow, &m));
  for (PetscInt i = 0; i < c->loc->nnode; i++) volume += m[i];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &volume, 1, MPIU_REAL, MPIU_SUM, c->comm));
  d->fluid = volume;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal weight[3][6];

    PetscCall(RigidInteriorVolume(c, k, weight));
    for (PetscInt i = 0; i < d->n; i++)
      PetscCall(PetscArraycpy(d->rigid[i] + k * c->nr, weight[d->integral[i].axis], c->nr));
  }
  PetscCall(CoupleGetInactiveVolume(c, &inactive));
  d->volume = volume + inactive;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does body k take part in the balance along axis a? */
static PetscBool is_carried(Couple c, PetscInt k, PetscInt a)
{
  return (PetscBool)(!c->s->removed[k] && !BodiesGetGroup(c->s, k)->body_fitted && BodiesIsFree(c->bodies, k, a));
}

/* What acts on the bodies that move freely along each axis: weight less buoyancy, external loads; then sums of sizes */
static PetscErrorCode sum_loads(Couple c, PetscReal load[2][3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(load[0], 6));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal force[3], torque[3];

    if (!c->s->own[k]) continue;
    PetscCall(BodiesGetLoad(c->bodies, k, c->par->density, c->par->gravity, force, torque));
    for (PetscInt a = 0; a < c->loc->dim; a++) {
      if (!is_carried(c, k, a)) continue;
      load[0][a] += force[a];
      load[1][a] += PetscAbsReal(force[a]);
    }
  }
  PetscCall(BodiesSum(c->bodies, 6, load[0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Weights of the rows, force that balances the weights */
static PetscErrorCode set_weights(Couple c, void *data)
{
  FlowRateControl d = (FlowRateControl)data;
  PetscReal       load[2][3];

  PetscFunctionBeginUser;
  PetscCall(evaluate_weights(c, d));
  for (PetscInt i = 0; i < d->n; i++) {
    d->integral[i].target = d->rate[d->integral[i].axis] * d->volume;
    d->integral[i].force  = 0;
    d->integral[i].rigid  = d->rigid[i];
  }
  if (d->backflow != FORCE) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(sum_loads(c, load));
  for (PetscInt a = 0; a < c->loc->dim; a++)
    if ((d->out.backflow >> a) & 1) d->force[a] = -load[0][a] / d->volume;
  PetscCall(FlowSetMeanPressureGradient(c->flow, d->force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Its forces count from now on, in the rigid rows g too. */
static PetscErrorCode take_force(Couple c, void *data)
{
  FlowRateControl d = (FlowRateControl)data;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < d->n; i++) {
    d->force[d->integral[i].axis] += d->integral[i].force;
    for (PetscInt j = 0; j < c->s->n * c->nr; j++) c->rigid.g[j] += d->integral[i].force * d->rigid[i][j];
  }
  PetscCall(FlowSetMeanPressureGradient(c->flow, d->force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Root mean square of the velocity */
static PetscErrorCode find_speed(Couple c, const struct _p_FlowRateControl *d, PetscReal *speed)
{
  const PetscReal *m;
  PetscReal        sum = 0;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(c->flow, &m));
  for (PetscInt i = 0; i < c->loc->nnode * c->loc->dim; i++)
    sum += PetscAbsReal(m[i / c->loc->dim]) * c->field.u[i] * c->field.u[i];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPIU_SUM, c->comm));
  *speed = PetscSqrtReal(sum / d->volume);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What accelerates fluid and free bodies as a whole, less what walls, openings, other bodies, contact and -flow_force
   do: as the solution has it, from rates of change and forces */
static PetscErrorCode measure_force(Couple c, const struct _p_FlowRateControl *d, const CoupleBalance *b,
                                    PetscReal net[3])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) net[a] = 0;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal excess = c->s->density[k] - CoupleInnerDensity(c, k);
    PetscReal       inertia[3], force_on_fluid[3], inactive[6], weight[3][6];

    if (!c->s->own[k]) continue;
    PetscCall(RigidForceOnFluid(c, k, inertia, force_on_fluid));
    PetscCall(RigidInteriorForce(c, k, inactive)); /* the uniform force on a body that is held counts as if on fluid */
    PetscCall(RigidInteriorVolume(c, k, weight));
    for (PetscInt a = 0; a < c->loc->dim; a++) {
      net[a] += is_carried(c, k, a) ? excess * inertia[a] - c->s->contact_force[k][a] : inactive[a] - force_on_fluid[a];
      net[a] -= inactive[a] - weight[a][a] * d->force[a];
    }
  }
  PetscCall(BodiesSum(c->bodies, 3, net));
  for (PetscInt a = 0; a < c->loc->dim; a++)
    net[a] += b->fluid[a] - b->walls[a] - b->openings[a] - (b->volume[a] - d->fluid * d->force[a]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure(Couple c, void *data, const FlowDiagnostics *diagnostics, CoupleBalance *b)
{
  FlowRateControl d = (FlowRateControl)data;
  PetscReal       load[2][3], net[3], speed = 0;

  PetscFunctionBeginUser;
  (void)diagnostics;
  PetscCall(PetscArraycpy(d->out.force, c->par->force, 3));
  d->out.error = 0;
  if (d->backflow == FLUX) PetscCall(find_speed(c, d, &speed));
  if (d->backflow == FORCE) PetscCall(sum_loads(c, load));
  if (d->backflow == FORCE) PetscCall(measure_force(c, d, b, net));
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    PetscReal error = 0;

    if (!((d->out.backflow >> a) & 1)) continue;
    if (d->backflow == FLUX && speed > 0) error = PetscAbsReal(b->mean[a]) / speed;
    if (d->backflow == FORCE && load[1][a] > 0) error = PetscAbsReal(net[a]) / load[1][a];
    d->out.error = PetscMax(d->out.error, error);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode print_axes(PetscInt axes, char text[8])
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) {
    if (!((axes >> a) & 1)) continue;
    if (n) text[n++] = ',';
    text[n++] = (char)('x' + a);
  }
  text[n] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(Couple c, void *data, PetscViewer viewer)
{
  FlowRateControl d = (FlowRateControl)data;
  char            axes[8];

  PetscFunctionBeginUser;
  if (c->par->rate_axes) {
    PetscCall(print_axes(c->par->rate_axes, axes));
    PetscCall(PetscViewerASCIIPrintf(viewer, "  mean velocity held along %s by a uniform force (-flow_rate)\n", axes));
  }
  if (d->backflow == NONE) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(print_axes(d->out.backflow, axes));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  back-flow along %s: zero %s (-couple_backflow)\n", axes,
                                   d->backflow == FLUX ? "net flux" : "mean force"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit(Couple c, void *data, State state)
{
  FlowRateControl d = (FlowRateControl)data;
  PetscBool       has;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "drive_force", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS); /* that run had none: the force is a start value only */
  PetscCall(StateReals(state, "drive_force", 3, d->force));
  if (StateIsLoading(state)) PetscCall(FlowSetMeanPressureGradient(c->flow, d->force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant FLOW_RATE = {.name    = "flow rate",
                                            .prepare = set_weights,
                                            .solved  = take_force,
                                            .balance = measure,
                                            .connect = connect_solver,
                                            .visit   = visit,
                                            .view    = view,
                                            .destroy = destroy};

PetscErrorCode CoupleAddFlowRate(Couple c)
{
  FlowRateControl d;
  PetscInt        backflow, axes;

  PetscFunctionBeginUser;
  PetscCall(read_backflow(c, &backflow, &axes));
  if (!axes && !c->par->rate_axes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&d));
  d->backflow       = backflow;
  d->out.backflow   = axes;
  d->out.controlled = c->par->rate_axes | (backflow == FLUX ? axes : 0);
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    if (!((d->out.controlled >> a) & 1)) continue;
    d->rate[a]        = (c->par->rate_axes >> a) & 1 ? c->par->rate[a] : 0;
    d->integral[d->n] = (FlowIntegral){.axis = a, .stuck = STUCK};
    PetscCall(BodiesAttachWork(c->bodies, (size_t)c->nr * sizeof(PetscReal), (void **)&d->rigid[d->n]));
    d->n++;
  }
  c->flow_rate = d;
  PetscCall(CoupleAddParticipant(c, &FLOW_RATE, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetFlowRate(Couple c, const FlowRateResult **result)
{
  PetscFunctionBeginUser;
  *result = c->flow_rate ? &c->flow_rate->out : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}
