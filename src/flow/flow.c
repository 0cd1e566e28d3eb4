/* Flow: parameters, fields and life cycle (see flow.h). Units: any consistent system. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"

static const char *const SCHEMES[]        = {"be", "cn", "bdf2", "fstheta", NULL};
static const char *const EXTRAPOLATIONS[] = {"linear", "quadratic", "auto", NULL};
static const char *const FORMS[]          = {"convective", "skew", "conservative", NULL};
static const char *const OPERATORS[]      = {"auto", "matrix_free", "assembled", NULL};

/* Without a matrix in space: its rows have 64 entries, and no part of the solver wants them as they are */
static PetscErrorCode choose_operator(Flow f)
{
  const PetscBool can  = (PetscBool)(!f->material || f->material->matrix_free);
  PetscInt        kind = 0;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-flow_velocity_operator", OPERATORS, &kind));
  PetscCheck(kind != 1 || can, f->comm, PETSC_ERR_USER_INPUT,
             "Option -flow_velocity_operator matrix_free knows one viscosity only, not that of -flow_rheology: leave it at auto");
  f->matrix.free = (PetscBool)(kind == 1 || (kind == 0 && f->loc->dim == 3 && can));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_parameters(Flow f)
{
  FlowParameters *p    = &f->par;
  PetscInt        form = 0;

  PetscFunctionBeginUser;
  p->density     = 1;
  p->viscosity   = 0.01;
  p->convection  = PETSC_TRUE;
  f->time.scheme = SCHEME_BDF2;
  PetscCall(FlowReadForces(f));
  PetscCall(OptReal("-flow_viscosity", &p->viscosity));
  p->solvent = p->matrix = p->viscosity;
  PetscCall(FlowChooseMaterial(f));
  PetscCall(choose_operator(f));
  PetscCall(OptBool("-flow_convection", &p->convection));
  PetscCall(OptChoice("-flow_convection_form", FORMS, &form));
  p->skew              = form == 1 ? 0.5 : 0;
  f->force.kept.wanted = (PetscBool)(form == 2);
  PetscCall(OptChoice("-flow_time", SCHEMES, &f->time.scheme));
  p->extrapolation = FLOW_AUTO;
  PetscCall(OptChoice("-flow_extrapolation", EXTRAPOLATIONS, &p->extrapolation));
  if (f->material && f->material->check)
    PetscCall((*f->material->check)(f, SCHEMES[f->time.scheme],
                                    (PetscBool)(f->time.scheme == SCHEME_BE || f->time.scheme == SCHEME_BDF2)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -flow_rate: which mean velocities are held, and the fluid starts with them */
static PetscErrorCode read_rate(Flow f)
{
  FlowParameters *p   = &f->par;
  const PetscInt  dim = f->loc->dim;
  PetscInt        open, axes    = 0;
  PetscBool       given, chosen = PETSC_FALSE, started;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-flow_rate", dim, p->rate, &given));
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ConditionsGetOpenAxes(f->boundary, &open));
  PetscCall(OptAxes("-flow_rate_axes", dim, &axes, &chosen));
  PetscCheck(chosen || open, f->comm, PETSC_ERR_USER_INPUT,
             "Option -flow_rate: the mean velocity of this scene is that of its boundaries, and no force changes it: remove it, or make an axis periodic "
             "(-mesh_periodic) or two opposite boundaries outflow (-flow_bc_<boundary>_type)");
  if (!chosen) axes = open;
  PetscCall(OptHas("-flow_velocity", &started));
  for (PetscInt d = 0; d < dim; d++) {
    const PetscBool wanted = (PetscBool)((axes >> d) & 1 || (!chosen && p->rate[d] != 0));

    PetscCheck(!wanted || (open >> d) & 1, f->comm, PETSC_ERR_USER_INPUT,
               "Option -flow_rate: the mean velocity along %c is that of the boundaries, and no force changes it: give 0 there (and leave %c out of -flow_rate_axes), "
               "or make the axis periodic (-mesh_periodic) or its two ends outflow (-flow_bc_<boundary>_type)",
               (char)('x' + d), (char)('x' + d));
    PetscCheck(wanted || p->rate[d] == 0, f->comm, PETSC_ERR_USER_INPUT,
               "Option -flow_rate gives %g along %c, which -flow_rate_axes does not name: add %c there, or give 0",
               (double)p->rate[d], (char)('x' + d), (char)('x' + d));
    PetscCheck(!wanted || f->force.given[d] == 0, f->comm, PETSC_ERR_USER_INPUT,
               "Options -flow_rate and -flow_force both act along %c: the force there is what holds the flow rate: set -flow_force to 0 along %c",
               (char)('x' + d), (char)('x' + d));
    if (wanted && !started) p->velocity[d] = p->rate[d];
  }
  p->rate_axes = axes;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCreate(Mesh mesh, Flow *flow)
{
  Flow             f;
  const MeshLocal *l;
  PetscInt         dim;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->mesh = mesh;
  PetscCall(MeshGetComm(mesh, &f->comm));
  PetscCall(MeshGetLocal(mesh, &f->loc));
  l   = f->loc;
  dim = l->dim;
  PetscCall(read_parameters(f));
  PetscCall(ElementCreate(dim, &f->element));
  PetscCall(PetscNew(&f->tables));
  BatchSetTables(dim, f->tables);
  PetscCall(FlowCreateComponents(f));
  if (f->material) PetscCall((*f->material->create)(f));
  PetscCall(read_rate(f));
  PetscCall(FlowCheckKept(f));
  PetscCall(FlowSetInitial(f));
  PetscCall(OnDeviceCreate(f, &f->device));
  *flow = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDestroy(Flow *flow)
{
  Flow f = *flow;

  PetscFunctionBeginUser;
  if (!f) PetscFunctionReturn(PETSC_SUCCESS);
  if (f->material) PetscCall((*f->material->destroy)(f));
  PetscCall(OnDeviceDestroy(&f->device));
  PetscCall(FlowDestroyComponents(f));
  PetscCall(ElementDestroy(&f->element));
  PetscCall(PetscFree(f->tables));
  PetscCall(ExprDestroy(&f->start.formula));
  PetscCall(ExprDestroy(&f->force.gravity));
  PetscCall(ExprDestroy(&f->force.expr));
  PetscCall(PetscFree(*flow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowView(Flow f, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "flow: density %g, viscosity %g, ", (double)f->par.density,
                                   (double)f->par.viscosity));
  if (f->step.dt > 0) PetscCall(PetscViewerASCIIPrintf(viewer, "time scheme %s, ", SCHEMES[f->time.scheme]));
  else PetscCall(PetscViewerASCIIPrintf(viewer, "steady, "));
  if (!f->par.convection) PetscCall(PetscViewerASCIIPrintf(viewer, "Stokes (no convection assembled)\n"));
  else
    PetscCall(PetscViewerASCIIPrintf(viewer, "Navier-Stokes%s\n", f->step.dt > 0 ? " (convection extrapolated)" : ""));
  if (f->material) PetscCall((*f->material->view)(f, viewer));
  PetscCall(ConditionsView(f->boundary, viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetParameters(Flow f, const FlowParameters **par)
{
  PetscFunctionBeginUser;
  *par = &f->par;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetMesh(Flow f, Mesh *mesh)
{
  PetscFunctionBeginUser;
  *mesh = f->mesh;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowHasSymmetricStress(Flow f)
{
  return FlowVaries(f);
}

PetscBool FlowIsViscoelastic(Flow f)
{
  return (PetscBool)(f->material == &FLOW_VISCOELASTIC);
}

PetscBool FlowIsMatrixFree(Flow f)
{
  return f->matrix.free;
}

Conditions FlowConditions(Flow f)
{
  return f->boundary;
}

PetscErrorCode FlowGetCellDivergence(Flow f, const PetscReal *const *b[])
{
  PetscFunctionBeginUser;
  *b = (const PetscReal *const *)f->cells.b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetCellSize(Flow f, const PetscReal *h[])
{
  PetscFunctionBeginUser;
  *h = f->cells.size;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetLumpedMass(Flow f, const PetscReal *m[])
{
  PetscFunctionBeginUser;
  *m = f->cells.lumped;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetFields(Flow f, PetscReal *u[], PetscReal *u_old[], PetscReal *p[])
{
  PetscFunctionBeginUser;
  if (f->device) PetscCall(OnDeviceBring(f, PETSC_TRUE));
  if (u) *u = f->u;
  if (u_old) *u_old = f->u_old;
  if (p) *p = f->p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetPressureGradient(Flow f, const PetscReal p[], PetscReal out[])
{
  const PetscInt nk = f->loc->dim + 1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->loc->ncell * nk; i++) out[i] = i % nk ? p[i] / f->cells.size[i / nk] : p[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowVisitState(void *flow, State state)
{
  Flow           f   = flow;
  const PetscInt dim = f->loc->dim;
  PetscBool      has;
  PetscInt       older = f->u_older ? 1 : -1; /* as loaded: -1 if the run had linear extrapolation; then the first step
                                                 is linear too */

  PetscFunctionBeginUser;
  if (f->device) PetscCall(OnDeviceBring(f, PETSC_TRUE));
  PetscCall(StateNodes(state, "velocity", dim, f->u));
  PetscCall(StateNodes(state, "velocity_old", dim, f->u_old));
  PetscCall(StateCells(state, "pressure", dim + 1, f->p));
  PetscCall(StateCells(state, "pressure_old", dim + 1, f->p_old));
  if (f->material && f->material->visit) PetscCall((*f->material->visit)(f, state));
  PetscCall(StateReals(state, "dt_old", 1, &f->time.dt_old));
  if (StateIsLoading(state) && (f->u_older || f->time.parabola))
    PetscCall(StateGetSize(state, "velocity_older", &older));
  if (older >= 0 && !f->u_older) PetscCall(PetscCalloc1(f->loc->nnode_all * dim, &f->u_older));
  if (older >= 0) PetscCall(StateNodes(state, "velocity_older", dim, f->u_older));
  if (older >= 0) PetscCall(StateReals(state, "dt_older", 1, &f->time.dt_older));
  PetscCall(StateHas(state, "cfl", &has));
  if (older >= 0 && f->time.parabola && has) PetscCall(StateReals(state, "cfl", 1, &f->time.cfl));
  PetscCall(StateHas(state, "momentum_taken", &has));
  if (f->force.kept.wanted && has) PetscCall(StateReals(state, "momentum_taken", 3, f->force.kept.impulse));
  PetscCall(StateInts(state, "steps", 1, &f->time.nsteps));
  PetscCall(StateInts(state, "substep", 1, &f->time.substep));
  PetscFunctionReturn(PETSC_SUCCESS);
}
