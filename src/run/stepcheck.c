/* StepCheck: see stepcheck.h. All numbers are the same on all ranks. */
#include "compat.h"
#include "stepcheck.h"
#include "base/algebra.h"
#include "base/domain.h"
#include "base/neargrid.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include <string.h>

enum {
  DIVERGENCE,
  MOMENTUM,
  GROWTH,
  INNER,
  BACKFLOW,
  NMEASURES
};

static const struct {
  const char *name, *what, *option;
} MEASURES[NMEASURES] = {
  [DIVERGENCE] = {"divergence", "the divergence of the velocity, in velocities a cell,", "-sim_check_divergence"},
  [MOMENTUM]   = {"momentum", "the error of the balance of momentum", "-sim_check_momentum"},
  [GROWTH]     = {"growth_of_energy", "the share by which the kinetic energy grows in a step without a source",
                  "-sim_check_growth"},
  [INNER]      = {"inner_solve",
                  "the number of solves for velocity or pressure that stop at their largest number of iterations", NULL},
  [BACKFLOW]   = {"backflow", "the error of the back-flow of -couple_backflow", "-sim_check_backflow"},
};

#define ENERGY_FLOOR 1e-3 /* of the largest energy so far: growth below is that of a flow that comes to rest */
#define NOISE        1e-9 /* of the momentum: forces below are round-off */
#define SOLENOIDAL   1e-9 /* divergence in velocities a cell: below, a solve for the pressure has nothing left to do */

struct _p_StepCheck {
  MPI_Comm              comm;
  Flow                  flow;
  Bodies                bodies;
  BodyState            *s;
  Couple                couple;
  PetscReal             bound[NMEASURES], value[NMEASURES]; /* bound 0: not checked */
  PetscReal             h, displacement_max, domain;        /* domain: volume of its box */
  PetscReal             speed_max, force_max, energy_max;   /* L2 norm of the velocity; sum of forces; so far */
  PetscReal             energy;                             /* of the step before */
  PetscBool             started, volume, fast, remarked[2];
  PetscBool             box;                           /* no boundaries but the faces of a box */
  PetscBool             far;                           /* it was remarked that a body goes far */
  PetscInt              steps, doubts, checked, walls; /* walls: ConditionsGetSolidFaces */
  Limits                limits;
  PetscInt              row[NMEASURES], row_displacement;
  const MeshLocal      *loc;
  const FlowRateResult *flow_rate; /* NULL: no back-flow to check */
  NearGrid              paths;     /* of the step that is checked; NULL: not asked for yet */
  PetscReal             reach;     /* half-width of the longest of them, or of all that there is */
};

/* Are the faces of a box all boundaries that there are? */
static PetscErrorCode is_box(Mesh mesh, PetscBool *box)
{
  PetscInt n;

  PetscFunctionBeginUser;
  *box = PETSC_TRUE;
  PetscCall(MeshGetBoundaryCount(mesh, &n));
  for (PetscInt b = 0; b < n; b++) {
    const char *name;
    PetscBool   face = PETSC_FALSE;

    PetscCall(MeshGetBoundaryName(mesh, b, &name));
    for (PetscInt i = 0; i < 6 && !face; i++) PetscCall(PetscStrcmp(name, DOMAIN_SIDE[i], &face));
    *box = (PetscBool)(*box && face);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is this measure out of its bound, or no number? */
static PetscBool exceeds(StepCheck j, PetscInt i)
{
  return (PetscBool)((j->bound[i] > 0 || i == INNER) && !(j->value[i] <= j->bound[i]));
}

static PetscErrorCode add_rows(StepCheck j)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < NMEASURES; i++) {
    const Limit row = {LIMIT_CHECK,
                       MEASURES[i].name,
                       MEASURES[i].what,
                       MEASURES[i].option,
                       "",
                       "the run stops after -sim_check_steps in a row",
                       j->bound[i],
                       NULL,
                       NULL};

    if (i == INNER ? j->fast : i == BACKFLOW ? j->flow_rate && j->bound[i] > 0 : j->bound[i] > 0)
      PetscCall(LimitsAdd(j->limits, &row, &j->row[i]));
  }
  if (j->displacement_max > 0)
    PetscCall(
      LimitsAdd(j->limits,
                &(Limit){LIMIT_CHECK, "passing", "the displacement of bodies past others", "-sim_max_displacement",
                         "radii", "the run stops where something is in the way, else a remark", j->displacement_max,
                         NULL, NULL},
                &j->row_displacement));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StepCheckCreate(Flow flow, Bodies bodies, Couple couple, Limits limits, StepCheck *check)
{
  StepCheck        j;
  Mesh             mesh;
  const MeshLocal *l;
  char             text[64];

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&j));
  j->flow   = flow;
  j->couple = couple;
  j->bodies = bodies;
  j->limits = limits;
  PetscCall(BodiesGetState(bodies, &j->s));
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetComm(mesh, &j->comm));
  PetscCall(is_box(mesh, &j->box));
  PetscCall(ConditionsGetSolidFaces(FlowConditions(flow), &j->walls));
  j->loc    = l;
  j->h      = l->h;
  j->domain = 1;
  for (PetscInt d = 0; d < l->dim; d++) j->domain *= l->upper[d] - l->lower[d];
  j->steps             = 5;
  j->displacement_max  = 1;
  j->bound[DIVERGENCE] = 0.1;
  j->bound[MOMENTUM]   = 0.05;
  j->bound[GROWTH]     = 0.2;
  j->bound[BACKFLOW]   = 1e-3;
  PetscCall(OptReal("-sim_check_divergence", &j->bound[DIVERGENCE]));
  PetscCall(OptReal("-sim_check_momentum", &j->bound[MOMENTUM]));
  PetscCall(OptReal("-sim_check_growth", &j->bound[GROWTH]));
  PetscCall(CoupleGetFlowRate(couple, &j->flow_rate));
  if (j->flow_rate && j->flow_rate->backflow) PetscCall(OptReal("-sim_check_backflow", &j->bound[BACKFLOW]));
  PetscCall(OptInt("-sim_check_steps", &j->steps));
  PetscCall(OptReal("-sim_max_displacement", &j->displacement_max));
  PetscCall(OptPeek("-flow_solver", text, sizeof(text)));
  PetscCall(PetscStrcasecmp(text, "fast", &j->fast));
  PetscCall(OptPeek("-couple_force", text, sizeof(text)));
  PetscCall(PetscStrcasecmp(text, "volume", &j->volume));
  PetscCall(add_rows(j));
  *check = j;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StepCheckDestroy(StepCheck *check)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(*check));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_growth(StepCheck j, const FlowDiagnostics *d, const CouplePower *p, PetscReal dt)
{
  const FlowElasticity *elastic;
  PetscReal             energy, made;

  PetscFunctionBeginUser;
  PetscCall(FlowGetElasticity(j->flow, &elastic));
  energy           = d->kinetic_energy + p->energy + (elastic ? elastic->energy : 0);
  made             = energy - j->energy - dt * PetscMax(0, p->power);
  j->energy_max    = PetscMax(j->energy_max, d->kinetic_energy + p->size);
  j->value[GROWTH] = j->started && made > 0 ? made / (PetscAbsReal(j->energy) + ENERGY_FLOOR * j->energy_max) : 0;
  j->energy        = energy;
  j->started       = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode count_inner(StepCheck j, PetscReal time)
{
  FlowSolver solver;
  PetscInt   limited[2];

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSolver(j->couple, &solver));
  PetscCall(FlowSolverGetLimited(solver, limited));
  /* as the flow comes to rest a solve has but the round-off of the steps before to work on, and does not end on it */
  if (j->value[DIVERGENCE] < SOLENOIDAL) limited[1] = 0;
  j->value[INNER] = j->fast ? limited[0] + limited[1] : 0;
  for (PetscInt i = 0; i < 2; i++) {
    const char *const name = i ? "pressure" : "velocity";

    if (!limited[i] || j->remarked[i]) continue;
    j->remarked[i] = PETSC_TRUE;
    PetscCall(
      LogRemark("the solve for the %s stopped at its largest number of iterations in the step to t = %g%s: lower -sim_dt, or raise "
                "-flow_fieldsplit_%s_ksp_max_it",
                name, (double)time, j->fast ? ", and solver fast does not make up for it" : "", name));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Are all forces so far the round-off of the momentum of a flow that nothing drives? */
static PetscBool only_noise(StepCheck j, const FlowParameters *par, PetscReal dt)
{
  return (PetscBool)(j->force_max * dt < NOISE * par->density * j->speed_max * PetscSqrtReal(j->domain));
}

PetscErrorCode StepCheckMeasure(StepCheck j, const FlowDiagnostics *d, const CoupleBalance *b, const CouplePower *p,
                                PetscReal time, PetscReal dt)
{
  const FlowParameters *par;
  PetscBool             doubt = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(j->flow, &par));
  j->speed_max         = PetscMax(j->speed_max, PetscSqrtReal(2 * d->kinetic_energy / par->density));
  j->force_max         = PetscMax(j->force_max, b->size);
  j->value[DIVERGENCE] = j->speed_max > 0 ? j->h * d->divergence / j->speed_max : 0;
  j->value[MOMENTUM]   = j->force_max > 0 && !j->volume && !only_noise(j, par, dt) ? b->error * b->size / j->force_max
                                                                                   : 0;
  j->value[BACKFLOW]   = j->flow_rate ? j->flow_rate->error : 0;
  PetscCall(measure_growth(j, d, p, dt));
  PetscCall(count_inner(j, time));
  for (PetscInt i = 0; i < NMEASURES; i++) {
    if (!exceeds(j, i)) continue;
    PetscCall(LimitsExceed(j->limits, j->row[i]));
    doubt = PETSC_TRUE;
  }
  j->doubts = doubt ? j->doubts + 1 : 0;
  j->checked++;
  PetscCall(PetscInfo(NULL, "step check: t %g divergence %g momentum %g growth %g inner %g\n", (double)time,
                      (double)j->value[DIVERGENCE], (double)j->value[MOMENTUM], (double)j->value[GROWTH],
                      (double)j->value[INNER]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- how far bodies go ---- */

/* Does body k come upon a wall, going straight from x for dt v? */
static PetscBool meets_wall(StepCheck j, PetscInt k, const PetscReal x[3], const PetscReal v[3], PetscReal dt)
{
  const PetscReal radius = BodiesGetRadius(j->s, k);

  for (PetscInt face = 0; face < 2 * j->s->dim; face++) {
    const PetscInt  a  = face / 2;
    const PetscReal to = x[a] + dt * v[a];

    if ((j->walls >> face & 1) && (face % 2 ? j->loc->upper[a] - to : to - j->loc->lower[a]) < radius)
      return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* Upon body i, which is at y beside it, or beside its nearest image, and goes for dt w? */
static PetscBool meets_body(StepCheck j, PetscInt k, const PetscReal x[3], const PetscReal v[3], PetscInt i,
                            const PetscReal y[3], const PetscReal w[3], PetscReal dt)
{
  const PetscReal reach = BodiesGetRadius(j->s, k) + BodiesGetRadius(j->s, i);
  PetscReal       r[3] = {0, 0, 0}, displacement[3] = {0, 0, 0}, fraction;

  for (PetscInt a = 0; a < j->s->dim; a++) {
    r[a]            = DomainNearest(j->loc->period[a], x[a], y[a]) - y[a];
    displacement[a] = dt * (v[a] - w[a]);
    /* or upon another image */
    if (j->loc->period[a] > 0 && PetscAbsReal(displacement[a]) > 0.5 * j->loc->period[a] - reach) return PETSC_TRUE;
  }
  fraction = dot3(displacement, displacement) > 0
             ? PetscMin(1, PetscMax(0, -dot3(r, displacement) / dot3(displacement, displacement)))
             : 0;
  for (PetscInt a = 0; a < 3; a++) r[a] += fraction * displacement[a];
  return (PetscBool)(dot3(r, r) < reach * reach);
}

/* Where body k is in the box at the beginning of a way, and its velocity there */
static void find_start(StepCheck j, PetscInt k, const PetscReal v[3], PetscReal back, PetscReal x[3], PetscReal w[3])
{
  for (PetscInt a = 0; a < 3; a++) {
    w[a] = v[a] - j->s->frame_u[a];
    x[a] = j->s->x[k][a] - back * w[a];
  }
}

/* Where it is in the middle of its way, in the box; half: half-width of a box around all of the way */
static void find_middle(StepCheck j, PetscInt k, const PetscReal v[3], PetscReal dt, PetscReal back, PetscReal x[3],
                        PetscReal *half)
{
  PetscReal w[3], fastest = 0;

  find_start(j, k, v, back - 0.5 * dt, x, w);
  for (PetscInt a = 0; a < 3; a++) {
    x[a]    = DomainWrap(j->loc->period[a], x[a], j->loc->lower[a]);
    fastest = PetscMax(fastest, PetscAbsReal(w[a]));
  }
  *half = BodiesGetRadius(j->s, k) + 0.5 * dt * fastest;
}

/* Boxes around the ways of all bodies, to be looked for at the middle of a way within the half-width of the longest.
   Everywhere, if they are so long beside a period that another image than the nearest may be met. */
static PetscErrorCode enter_paths(StepCheck j, const PetscReal (*v)[3], PetscReal dt, PetscReal back)
{
  const MeshLocal *l = j->loc;
  PetscReal(*x)[3], *half, whole = 0;
  PetscBool all = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(j->s->n, &x, j->s->n, &half));
  j->reach = 0;
  for (PetscInt k = 0; k < j->s->n; k++) {
    find_middle(j, k, v[k], dt, back, x[k], &half[k]);
    j->reach = PetscMax(j->reach, half[k]);
    if (j->s->removed[k]) half[k] = -1;
  }
  for (PetscInt a = 0; a < l->dim; a++) {
    all = (PetscBool)(all || (l->period[a] > 0 && 8 * j->reach > l->period[a]));
    whole += l->upper[a] - l->lower[a];
  }
  if (all) j->reach = PetscMax(j->reach, whole);
  PetscCall(NearGridCreate(l->dim, l->lower, l->upper, l->period, j->s->n, (const PetscReal(*)[3])x, half, &j->paths));
  PetscCall(PetscFree2(x, half));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is something in the way of body k, if all go at v [n][3] for dt, or have gone so (done)? By bounding spheres. Until
   the ways are forgotten, of the same ones. */
static PetscErrorCode is_barred(StepCheck j, PetscInt k, const PetscReal (*v)[3], PetscReal dt, PetscBool done,
                                PetscBool *barred)
{
  const PetscReal back = done ? dt : 0;
  const PetscInt *body;
  PetscReal       x[3], y[3], u[3], w[3], middle[3], half;
  Grid            grid;

  PetscFunctionBeginUser;
  find_start(j, k, v[k], back, x, u);
  *barred = (PetscBool)(!j->box || meets_wall(j, k, x, u, dt));
  if (*barred) PetscFunctionReturn(PETSC_SUCCESS);
  if (!j->paths) PetscCall(enter_paths(j, v, dt, back));
  find_middle(j, k, v[k], dt, back, middle, &half);
  PetscCall(NearGridGet(j->paths, j->reach, &grid, &body));
  for (PetscInt e = GridFirst(grid, middle); e >= 0 && !*barred; e = GridNext(grid, e)) {
    const PetscInt i = body[GridItem(grid, e)];

    find_start(j, i, v[i], back, y, w);
    *barred = (PetscBool)(i != k && meets_body(j, k, x, u, i, y, w, dt));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* way in radii of body k that the message is about */
static PetscErrorCode refuse_displacement(StepCheck j, PetscInt k, PetscReal displacement, PetscReal time, PetscReal dt,
                                          PetscBool adapted)
{
  PetscFunctionBeginUser;
  SETERRQ(j->s->n < j->s->nall ? PETSC_COMM_SELF : j->comm, PETSC_ERR_NOT_CONVERGED,
          "Body %" PetscInt_FMT
          " (group '%s') goes %.4g of its radii in the step to t = %g, more than -sim_max_displacement (%g), and would pass through what is in its way: lower %s (the step "
          "was %g), such as to %.2g",
          j->s->number[k], BodiesGetGroup(j->s, k)->name, (double)displacement, (double)time,
          (double)j->displacement_max, adapted ? "-sim_adapt_min" : "-sim_dt", (double)dt,
          (double)(0.5 * dt * j->displacement_max / displacement));
}

PetscErrorCode StepCheckPredicted(StepCheck j, PetscReal (*a)[3], PetscBool start, PetscReal time, PetscReal dt,
                                  PetscBool adapted)
{
  PetscReal(*v)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(j->s->n, &v));
  for (PetscInt k = 0; k < j->s->n; k++)
    for (PetscInt d = 0; d < 3; d++)
      v[k][d] = j->s->u[k][d] + (d < j->s->dim && BodiesIsFree(j->bodies, k, d) ? dt * a[k][d] : 0);
  for (PetscInt k = 0; k < j->s->n && j->displacement_max > 0; k++) {
    PetscReal displacement = 0, contact = start ? 1 : 0;
    PetscBool barred;

    for (PetscInt d = 0; d < j->s->dim; d++) {
      displacement += PetscSqr(dt * (v[k][d] - j->s->u[k][d]));
      contact += PetscAbsReal(j->s->contact_force[k][d]);
    }
    if (j->s->removed[k] || contact == 0) continue;
    displacement = PetscSqrtReal(displacement) / BodiesGetRadius(j->s, k);
    if (displacement <= j->displacement_max) continue;
    PetscCall(is_barred(j, k, v, dt, PETSC_FALSE, &barred));
    if (barred) PetscCall(refuse_displacement(j, k, displacement, time, dt, adapted));
  }
  PetscCall(NearGridDestroy(&j->paths));
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StepCheckDisplacement(StepCheck j, PetscReal time, PetscReal dt, PetscBool adapted)
{
  PetscBool far = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < j->s->n && j->displacement_max > 0; k++) {
    const PetscReal displacement = BodiesFastestPoint(j->s, k, 0) * dt / BodiesGetRadius(j->s, k);
    PetscBool       barred;

    if (displacement <= j->displacement_max || j->s->removed[k]) continue;
    PetscCall(is_barred(j, k, j->s->u, dt, PETSC_TRUE, &barred));
    if (barred) PetscCall(refuse_displacement(j, k, displacement, time, dt, adapted));
    far = PETSC_TRUE;
  }
  PetscCall(NearGridDestroy(&j->paths));
  PetscCall(BodiesAny(j->bodies, &far));
  if (far) PetscCall(LimitsExceed(j->limits, j->row_displacement));
  if (far && !j->far)
    PetscCall(
      LogRemark("a body goes more than %g of its radii (-sim_max_displacement) in the step to t = %g. Nothing is in its way, but the flow does not see "
                "the places between: less accurate; lower %s (%g)",
                (double)j->displacement_max, (double)time, adapted ? "-sim_adapt_max" : "-sim_dt", (double)dt));
  j->far = (PetscBool)(j->far || far);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool StepCheckDoubts(StepCheck j)
{
  return (PetscBool)(j->doubts > 0);
}

/* What exceeds its bound most, as the middle of a sentence */
static PetscErrorCode describe_worst(StepCheck j, char why[], size_t size)
{
  PetscInt worst = -1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < NMEASURES; i++) {
    if (!exceeds(j, i)) continue;
    if (worst < 0 || j->value[i] * j->bound[worst] > j->value[worst] * j->bound[i]) worst = i;
  }
  PetscCall(PetscSNPrintf(why, size, "%s is %.3g", MEASURES[worst].what, (double)j->value[worst]));
  if (MEASURES[worst].option) {
    const size_t n = strlen(why);

    PetscCall(PetscSNPrintf(why + n, size - n, ", beyond %s (%g)", MEASURES[worst].option, (double)j->bound[worst]));
  }
  PetscCall(PetscSNPrintf(why + strlen(why), size - strlen(why),
                          ", after %" PetscInt_FMT " steps out of bounds in a row", j->doubts));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StepCheckResult(StepCheck j, PetscBool last, char why[], size_t size)
{
  const PetscBool whole = (PetscBool)(last && j->doubts > 1 && j->doubts == j->checked);

  PetscFunctionBeginUser;
  why[0] = 0;
  if (!j->steps || !j->doubts) PetscFunctionReturn(PETSC_SUCCESS);
  if (j->doubts >= j->steps || whole) PetscCall(describe_worst(j, why, size));
  else if (last) {
    char text[256];

    PetscCall(describe_worst(j, text, sizeof(text)));
    PetscCall(LogRemark("the run ends in doubt: %s; lower -sim_dt, or refine the mesh", text));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
