/* Estimate: see estimate.h. */
#include "compat.h"
#include "estimate.h"
#include "base/algebra.h"
#include "base/log.h"
#include "bodies/local.h"

#define BODY_CELLS  3   /* a step, beyond which it is remarked: estimates are rough, 1.3 cells cost little */
#define FLUID_CELLS 10  /* likewise, of the fluid where it is fastest */
#define TIMES       100 /* at which a prescribed motion is looked at */
#define FEW         16  /* bodies of a group, likewise */
#define LAMINAR     10  /* at most so many times sqrt(force length/density): beyond it a channel is turbulent */

/* A group: its largest body, how fast its surface is, how fast it goes (a disc that turns goes nowhere), and by what */
typedef struct {
  PetscReal   radius, density, across, speed, goes; /* across: cells */
  const char *by;
} GroupEstimate;

/* Speeds of what is prescribed, as far as the run goes */
static PetscErrorCode find_prescribed_speeds(const SimComponents *p, PetscInt k, PetscReal end, PetscReal v[2])
{
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &s));
  for (PetscInt i = 0; i <= TIMES; i++) {
    PetscReal u[3], w[3];

    PetscCall(BodiesGetPrescribedVelocity(p->bodies, k, end * i / TIMES, u, w));
    v[0] = PetscMax(v[0], PetscSqrtReal(dot3(u, u)) + PetscSqrtReal(dot3(w, w)) * BodiesGetRadius(s, k));
    v[1] = PetscMax(v[1], BodiesPointSpeed(s, k, u, w));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest of the known bodies of a group, and the speed of the fastest at the start */
static PetscErrorCode look_at_bodies(const SimComponents *p, PetscInt group, PetscReal h, PetscReal end,
                                     GroupEstimate *e)
{
  BodyState *s;
  PetscReal  v[4] = {0, 0, 0, 0}, smallest = PETSC_MAX_REAL; /* radius, density, speeds; smallest radius */
  PetscInt   looked = 0;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &s));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal r = BodiesGetRadius(s, k);

    if (s->body_group[k] != group || s->removed[k]) continue;
    v[0]     = PetscMax(v[0], r);
    v[1]     = PetscMax(v[1], s->density[k]);
    smallest = PetscMin(smallest, r);
    if (looked++ < FEW) PetscCall(find_prescribed_speeds(p, k, s->group[group].motion.given ? end : 0, v + 2));
  }
  PetscCall(BodiesMax(p->bodies, 4, v));
  PetscCall(BodiesMin(p->bodies, 1, &smallest));
  e->radius  = v[0];
  e->density = v[1];
  e->speed   = v[2];
  e->goes    = v[3];
  e->across  = smallest < PETSC_MAX_REAL ? 2 * smallest / h : 0;
  e->by      = e->speed == 0 ? "stands still" : s->group[group].motion.given ? "moves with up to" : "starts with";
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Drag of a cylinder (a unit of its length) or sphere in the reference to which c_D belongs */
static PetscReal find_drag(PetscInt dim, const FlowParameters *par, PetscReal radius, PetscReal speed)
{
  const PetscReal Re = par->density * speed * 2 * radius / par->viscosity;
  const PetscReal c  = dim == 2 ? 1 + 10 / PetscPowReal(Re, 2. / 3) : 24 / Re + 6 / (1 + PetscSqrtReal(Re)) + 0.4;

  return 0.5 * par->density * speed * speed * c * (dim == 2 ? 2 * radius : PETSC_PI * radius * radius);
}

/* Speed at which the drag is `force`, by bisection of its logarithm */
static PetscReal find_fall(PetscInt dim, const FlowParameters *par, PetscReal radius, PetscReal force)
{
  PetscReal low, high;

  if (!(force > 0) || !(radius > 0)) return 0;
  high = PetscSqrtReal(force / (par->density * PetscPowRealInt(radius, dim - 1))) * 10; /* c_D is nowhere below .4 */
  for (low = high; find_drag(dim, par, radius, low) > force;) low *= 0.1;
  for (PetscInt i = 0; i < 60; i++) {
    const PetscReal middle = PetscSqrtReal(low * high);

    if (find_drag(dim, par, radius, middle) > force) high = middle;
    else low = middle;
  }
  return low;
}

static PetscErrorCode estimate_group(const SimComponents *p, Sim sim, PetscInt group, PetscReal flow, GroupEstimate *e)
{
  const MeshLocal      *l;
  const FlowParameters *par;
  const BodyGroup      *g;
  BodyState            *s;
  PetscReal             force = 0, fall, dt, end;
  PetscBool             adapted;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(p->mesh, &l));
  PetscCall(FlowGetParameters(p->flow, &par));
  PetscCall(BodiesGetState(p->bodies, &s));
  g = s->group + group;
  PetscCall(SimGetStep(sim, &dt, &end, &adapted));
  PetscCall(look_at_bodies(p, group, l->h, end, e));
  for (PetscInt a = 0; a < l->dim; a++) {
    const PetscReal volume = g->mass.volume * PetscPowRealInt(g->largest, l->dim);

    if (g->free >> a & 1)
      force += PetscSqr((e->density - par->density) * volume * par->gravity[a] + g->motion.force[a]);
  }
  fall = find_fall(l->dim, par, e->radius, PetscSqrtReal(force));
  if (fall > e->speed) {
    e->speed = e->goes = fall;
    e->by              = "falls or rises with about";
  }
  if (g->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z) && flow > e->speed) {
    e->speed = flow; /* where it is carried is not known: the fluid's own step says how far */
    e->by    = "is carried with up to";
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The largest speed of the fluid that the scene says, and that of a uniform force between the nearest walls */
static PetscErrorCode estimate_flow(const SimComponents *p, PetscReal *speed)
{
  const MeshLocal      *l;
  const FlowParameters *par;
  PetscReal            *u, start = 0, force = 0, width = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(p->mesh, &l));
  PetscCall(FlowGetParameters(p->flow, &par));
  PetscCall(FlowGetFields(p->flow, &u, NULL, NULL));
  PetscCall(ConditionsGetSpeed(FlowConditions(p->flow), speed));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal v = 0;

    for (PetscInt a = 0; a < l->dim; a++) v += PetscSqr(u[i * l->dim + a]);
    start = PetscMax(start, v);
  }
  start = PetscSqrtReal(start);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &start, 1, MPIU_REAL, MPIU_MAX, p->comm));
  for (PetscInt a = 0; a < l->dim; a++) {
    force += PetscSqr(par->force[a]);
    if (l->period[a] == 0) width = PetscMin(width, l->upper[a] - l->lower[a]);
  }
  force  = PetscSqrtReal(force);
  *speed = PetscMax(*speed, start);
  if (force > 0 && width < PETSC_MAX_REAL)
    *speed = PetscMax(*speed, PetscMin(force * width * width / (8 * par->viscosity),
                                       LAMINAR * PetscSqrtReal(force * width / par->density)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- units ---- */

/* Density, viscosity and gravity in SI, as far as the units that the scene names go */
static PetscErrorCode view_units(const SimComponents *p, PetscViewer viewer)
{
  const FlowParameters *par;
  const MeshLocal      *l;
  const char           *unit[3];
  PetscReal             si[3];

  PetscFunctionBeginUser;
  PetscCall(MonitorGetUnits(p->monitor, unit, si));
  if (si[0] == 0 || (si[1] == 0 && si[2] == 0)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetParameters(p->flow, &par));
  PetscCall(MeshGetLocal(p->mesh, &l));
  PetscCall(PetscViewerASCIIPrintf(viewer, "in SI units:"));
  if (si[2] > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, " fluid density %.4g kg/m^3",
                                     (double)(par->density * si[2] / PetscPowRealInt(si[0], 3))));
  if (si[1] > 0 && si[2] > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", viscosity %.4g Pa s (kinematic %.4g m^2/s)",
                                     (double)(par->viscosity * si[2] / (si[0] * si[1])),
                                     (double)(par->viscosity / par->density * si[0] * si[0] / si[1])));
  if (si[1] > 0) {
    PetscCall(PetscViewerASCIIPrintf(viewer, "%s gravity", si[2] > 0 ? "," : ""));
    for (PetscInt a = 0; a < l->dim; a++)
      PetscCall(
        PetscViewerASCIIPrintf(viewer, "%s %.4g", a ? "," : "", (double)(par->gravity[a] * si[0] / (si[1] * si[1]))));
    PetscCall(PetscViewerASCIIPrintf(viewer, " m/s^2"));
  }
  PetscCall(
    PetscViewerASCIIPrintf(viewer, "%s\n", l->dim == 2 && si[2] > 0 ? ", masses and forces a metre of depth" : ""));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ", in SI density 2500 kg/m^3, diameter 0.001 m" */
static PetscErrorCode view_group_units(const SimComponents *p, const GroupEstimate *e, PetscViewer viewer)
{
  const char *unit[3];
  PetscReal   si[3];

  PetscFunctionBeginUser;
  PetscCall(MonitorGetUnits(p->monitor, unit, si));
  if (si[0] > 0) PetscCall(PetscViewerASCIIPrintf(viewer, "; in SI diameter %.4g m", (double)(2 * e->radius * si[0])));
  if (si[0] > 0 && si[2] > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", density %.4g kg/m^3",
                                     (double)(e->density * si[2] / PetscPowRealInt(si[0], 3))));
  if (si[0] > 0 && si[1] > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", %.4g m/s", (double)(e->speed * si[0] / si[1])));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- doors ---- */

PetscErrorCode EstimateView(const SimComponents *p, Sim sim, PetscViewer viewer)
{
  const FlowParameters *par;
  const MeshLocal      *l;
  BodyState            *s;
  PetscReal             dt, end, flow;
  PetscBool             adapted, steps;

  PetscFunctionBeginUser;
  if (!p->flow) PetscFunctionReturn(PETSC_SUCCESS);
  steps = (PetscBool)!p->steady;
  PetscCall(view_units(p, viewer));
  PetscCall(SimGetStep(sim, &dt, &end, &adapted));
  PetscCall(estimate_flow(p, &flow));
  PetscCall(FlowGetParameters(p->flow, &par));
  PetscCall(MeshGetLocal(p->mesh, &l));
  PetscCall(BodiesGetState(p->bodies, &s));
  PetscCall(PetscViewerASCIIPrintf(viewer, "estimate: fluid "));
  if (flow > 0) PetscCall(PetscViewerASCIIPrintf(viewer, "up to %.3g", (double)flow));
  else PetscCall(PetscViewerASCIIPrintf(viewer, "moved by the bodies alone"));
  if (flow > 0 && steps) PetscCall(PetscViewerASCIIPrintf(viewer, ", %.2g cells a step", (double)(flow * dt / l->h)));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    GroupEstimate e;
    PetscReal     speed;

    PetscCall(estimate_group(p, sim, g, flow, &e));
    if (s->group[g].count == 0) continue;
    speed = PetscMax(e.speed, flow);
    PetscCall(PetscViewerASCIIPrintf(viewer, "estimate: group %s %s", s->group[g].name, e.by));
    if (e.speed > 0) PetscCall(PetscViewerASCIIPrintf(viewer, " %.3g", (double)e.speed));
    PetscCall(PetscViewerASCIIPrintf(viewer, ", Reynolds number %.3g, %.3g cells across",
                                     (double)(par->density * speed * 2 * e.radius / par->viscosity), (double)e.across));
    if (steps) PetscCall(PetscViewerASCIIPrintf(viewer, ", %.2g cells a step", (double)(e.goes * dt / l->h)));
    PetscCall(view_group_units(p, &e, viewer));
    PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode EstimateRemark(const SimComponents *p, Sim sim)
{
  const MeshLocal *l;
  BodyState       *s;
  PetscReal        dt, end, flow;
  PetscBool        adapted;

  PetscFunctionBeginUser;
  if (!p->flow || p->steady) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SimGetStep(sim, &dt, &end, &adapted));
  if (adapted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(estimate_flow(p, &flow));
  PetscCall(MeshGetLocal(p->mesh, &l));
  PetscCall(BodiesGetState(p->bodies, &s));
  if (flow * dt > FLUID_CELLS * l->h)
    PetscCall(
      LogRemark("the fluid goes about %.2g cells (of the smallest) in a step of -sim_dt %g, at a speed of %.3g: too far to be right in time; lower "
                "-sim_dt, such as to %.2g, or give -sim_adapt",
                (double)(flow * dt / l->h), (double)dt, (double)flow, (double)(l->h / flow)));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    GroupEstimate e;

    PetscCall(estimate_group(p, sim, g, flow, &e));
    if (s->group[g].count == 0 || e.goes * dt <= BODY_CELLS * l->h) continue;
    PetscCall(
      LogRemark("group '%s' %s %.3g, about %.2g cells (of the smallest) in a step of -sim_dt %g, and preset balanced promises its 1 %% up to about one "
                "cell: lower -sim_dt, such as to %.2g, or give -preset fast or accurate, which choose the step",
                s->group[g].name, e.by, (double)e.goes, (double)(e.goes * dt / l->h), (double)dt,
                (double)(l->h / e.goes)));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
