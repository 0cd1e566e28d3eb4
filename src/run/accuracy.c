/* Accuracy: see accuracy.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "accuracy.h"
#include "gauge.h"
#include "accuracyimpl.h"
#include "coarser.h"
#include "base/agree.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "failure.h"
#include "promise.h"
#include <string.h>

#define BODIES_MAX 64
#define CORNERED   1.1  /* order of errors of aligned meshes, at least: with corners (1.09 at 270 degrees, slow) */
#define DRAWN      1.25 /* order of errors: what bodies that are drawn add; aligned meshes, at least and at most */
#define DRAWN_MAX  2.5
#define ORDER_MIN  2.5
#define ORDER_MAX  3.5
#define HALF       2.0 /* cells of a mesh, times those of the one before */
#define THICK      2   /* cells, of a body that a mesh lined up with it tells the truth about */
#define BETWEEN    1.5
#define ERROR_MIN  2e-5 /* estimate: the difference may vanish where errors do not */

/* What is measured on a mesh */
typedef struct {
  PetscReal force[3 * BODIES_MAX], velocity[3], energy; /* velocity: integral over the fluid */
} Measured;

/* ---- two meshes ---- */

/* After CoupleForce. Collective. */
static PetscErrorCode measure(const SimComponents *p, Measured *m)
{
  BodyState       *s;
  FlowDiagnostics  d;
  const PetscReal *u, *q;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(m, sizeof(*m)));
  PetscCall(BodiesGetState(p->bodies, &s));
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt a = 0; a < 3 && s->own[k]; a++) m->force[3 * s->number[k] + a] = s->force[k][a];
  PetscCall(BodiesSum(p->bodies, 3 * s->nall, m->force));
  PetscCall(CoupleGetSolution(p->couple, &u, &q));
  PetscCall(FlowDiagnose(p->flow, u, q, &d));
  m->energy = d.kinetic_energy;
  for (PetscInt a = 0; a < 3; a++) m->velocity[a] = d.velocity[a]; /* whatever part of the bodies counts as fluid */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A mesh that is lined up, but not with all bodies, tells nothing of those that it leaves to the penalty */
static PetscErrorCode refuse_prescribed(Couple couple)
{
  const CoupleCount *count;
  PetscInt           n;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetCounts(couple, &n, &count));
  for (PetscInt i = 0; i < n; i++)
    PetscCheck(strcmp(count[i].name, "aligned_penalty_bodies") != 0 || count[i].value == 0, RunComm(), PETSC_ERR_SUP,
               "The mesh does not line up with all bodies");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve_other(const SimComponents *p, SimComponents *other, Measured *m)
{
  PetscInt its, linear;

  PetscFunctionBeginUser;
  PetscCall((*p->make)(other));
  PetscCall(SteadySetUp(other->steady));
  PetscCall(SteadySolve(other->steady, &its, &linear));
  PetscCall(CoupleForce(other->couple));
  PetscCall(refuse_prescribed(other->couple));
  PetscCall(measure(other, m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Are bodies drawn, by a method whose errors go by no order? */
static PetscErrorCode are_drawn(const SimComponents *p, PetscBool *drawn)
{
  BodyState *s;
  char       method[64];

  PetscFunctionBeginUser;
  *drawn = PETSC_FALSE;
  PetscCall(BodiesGetState(p->bodies, &s));
  for (PetscInt g = 0; g < s->ngroups; g++)
    *drawn = (PetscBool)(*drawn || (s->group[g].count && !s->group[g].body_fitted));
  PetscCall(OptPeek("-couple_method", method, sizeof(method)));
  if (!strcasecmp(method, "aligned")) *drawn = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of an aligned mesh */
static PetscErrorCode find_order(const SimComponents *p, PetscReal *order)
{
  BodyState *s;
  PetscReal  largest = 0;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &s));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscInt n;

    PetscCall(BodiesGetCorners(p->bodies, k, s->x[k], s->q[k], 0, &n, NULL));
    largest = PetscMax(largest, (PetscReal)n);
  }
  PetscCall(BodiesMax(p->bodies, 1, &largest));
  *order = largest > 0 ? CORNERED : ORDER_MIN;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyFindOrder(const SimComponents *p, PetscReal *order)
{
  PetscBool drawn;

  PetscFunctionBeginUser;
  PetscCall(find_order(p, order));
  PetscCall(are_drawn(p, &drawn));
  if (drawn) *order = PetscMin(*order, DRAWN);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What is judged: the largest force of all along its axis; where -flow_force drives the fluid, and so gives that, the
   mean velocity; without forces the kinetic energy */
typedef struct {
  PetscReal (*of)(const Measured *, PetscInt);
  PetscInt  n, axis; /* values that are compared, the first one at `axis`, then every third */
  PetscReal size;
  char      name[32];
} Subject;

static PetscReal get_force(const Measured *m, PetscInt i)
{
  return m->force[i];
}

static PetscReal get_velocity(const Measured *m, PetscInt i)
{
  return m->velocity[i];
}

static PetscReal get_energy(const Measured *m, PetscInt i)
{
  (void)i;
  return m->energy;
}

static PetscErrorCode choose_subject(const SimComponents *p, const Measured *m, Subject *s)
{
  const FlowParameters *par;
  BodyState            *b;
  PetscBool             driven = PETSC_FALSE;
  PetscInt              n;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &b));
  PetscCall(FlowGetParameters(p->flow, &par));
  for (PetscInt a = 0; a < 3; a++) driven = (PetscBool)(driven || par->force[a] != 0);
  *s   = (Subject){.of = driven ? get_velocity : get_force};
  n    = driven ? 3 : 3 * b->nall;
  s->n = driven ? 1 : b->nall;
  for (PetscInt i = 0; i < n; i++) {
    if (PetscAbsReal((*s->of)(m, i)) <= s->size) continue;
    s->size = PetscAbsReal((*s->of)(m, i));
    s->axis = i % 3;
  }
  (void)snprintf(s->name, sizeof(s->name), "%s_%c", driven ? "mean_velocity" : "force", (char)('x' + s->axis));
  if (s->size > 0) PetscFunctionReturn(PETSC_SUCCESS);
  *s = (Subject){.of = get_energy, .n = 1, .size = m->energy, .name = "kinetic_energy"};
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal differ(const Subject *s, const Measured *m, const Measured *other)
{
  PetscReal largest = 0;

  for (PetscInt i = 0; i < s->n; i++)
    largest = PetscMax(largest, PetscAbsReal((*s->of)(m, s->axis + 3 * i) - (*s->of)(other, s->axis + 3 * i)));
  return s->size > 0 ? largest / s->size : 0;
}

/* Difference of the second and the third of three meshes beside that of the first two, of an error of that order */
static PetscReal get_growth(const PetscReal ratio[], PetscReal order)
{
  const PetscReal first = PetscPowReal(ratio[0], order);

  return first * (PetscPowReal(ratio[1], order) - 1) / (first - 1);
}

/* Error on the finest of n meshes. Of three the order is seen, within bounds; the difference of the two finest may be
   small by chance, but not beside that of the others. Those of corners come and go with the places of nodes: the
   largest difference of all counts. What bodies that are drawn add goes by no order. */
static PetscReal estimate_error(const Subject *s, const Measured m[], const PetscReal ratio[], PetscInt n,
                                PetscReal order, PetscBool drawn)
{
  PetscReal first = differ(s, &m[0], &m[1]), before, low = order, high = ORDER_MAX;

  if (n == 3) {
    before = differ(s, &m[1], &m[2]);
    /* where bodies are drawn the third mesh may hardly see them */
    if (drawn) first = PetscMax(first, PetscMin(2 * first, before / get_growth(ratio, DRAWN_MAX)));
    else first = PetscMax(first, before / get_growth(ratio, ORDER_MAX));
    if (!drawn && order < ORDER_MIN) first = PetscMax(first, PetscMax(before, differ(s, &m[0], &m[2])));
    for (PetscInt i = 0; i < 30 && !drawn; i++) {
      order = 0.5 * (low + high);
      if (get_growth(ratio, order) * first < before) low = order;
      else high = order;
    }
  }
  return PetscMax(ERROR_MIN, first / (PetscPowReal(ratio[0], order) - 1));
}

/* ---- what is said ---- */

PetscErrorCode AccuracyReport(const SimComponents *p, const char what[], PetscReal error, const PetscReal by_source[2])
{
  static const char *const SOURCE[] = {"space", "time"};
  char                     name[64];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(name, sizeof(name), "estimated_error_%s", what));
  PetscCall(MonitorQuantity(p->monitor, name, error));
  PetscCall(PetscPrintf(RunComm(), "estimated error of %s: %.2g %%", what, (double)(100 * error)));
  for (PetscInt i = 0; i < 2 && by_source; i++) {
    PetscCall(PetscPrintf(RunComm(), "%s%s ", i ? ", " : " (", SOURCE[i]));
    if (by_source[i] < 0) PetscCall(PetscPrintf(RunComm(), "not known"));
    if (by_source[i] < 0) continue;
    PetscCall(PetscSNPrintf(name, sizeof(name), "estimated_error_%s_%s", what, SOURCE[i]));
    PetscCall(MonitorQuantity(p->monitor, name, by_source[i]));
    PetscCall(PetscPrintf(RunComm(), "%.2g %%", (double)(100 * by_source[i])));
  }
  PetscCall(PetscPrintf(RunComm(), "%s\n", by_source ? ")" : ""));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyCompare(const char what[], PetscReal error, const PetscReal by_source[2], PetscReal order)
{
  char      name[64];
  PetscInt  preset = PROMISE_DEFAULT;
  PetscReal promised;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-preset", name, sizeof(name)));
  if (!name[0]) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; PROMISE_PRESETS[i]; i++)
    if (!strcasecmp(name, PROMISE_PRESETS[i])) preset = i;
  promised = 0.01 * PromisePercent(preset);
  if (error <= promised) PetscFunctionReturn(PETSC_SUCCESS);
  if (by_source && by_source[1] > by_source[0])
    PetscCall(
      LogRemark("-preset %s promises %g %%, and the estimated error of %s is %.2g %%, most of it of the steps: about %.1f times as many keep the promise "
                "(-sim_dt, -sim_adapt_max)",
                PROMISE_PRESETS[preset], (double)(100 * promised), what, (double)(100 * error),
                (double)PetscSqrtReal(error / promised)));
  else
    PetscCall(
      LogRemark("-preset %s promises %g %%, and the estimated error of %s on this mesh is %.2g %%: refine it, about %.1f times as many cells along each "
                "axis keep the promise (-mesh_cells, -mesh_resolution, -mesh_levels)%s",
                PROMISE_PRESETS[preset], (double)(100 * promised), what, (double)(100 * error),
                (double)PetscPowReal(error / promised, 1 / order),
                by_source ? "" : ", or let the flow choose them (-mesh_adapt)"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyIsWanted(PetscBool steady, PetscBool *wanted)
{
  char preset[64];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-preset", preset, sizeof(preset)));
  *wanted = (PetscBool)(steady && preset[0] != 0);
  PetscCall(OptBool("-monitor_accuracy", wanted));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyIsGauged(const SimComponents *p, PetscBool trial, PetscBool *gauged)
{
  BodyState *s;

  PetscFunctionBeginUser;
  *gauged = trial;
  if (!p->flow || p->steady) *gauged = PETSC_FALSE;
  else if (!trial) PetscCall(AccuracyIsWanted(PETSC_FALSE, gauged));
  PetscCall(BodiesGetState(p->bodies, &s));
  if (p->deform || s->nall > GAUGE_BODIES) *gauged = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode is_wanted(const SimComponents *p, PetscBool *wanted)
{
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &s));
  if (!p->flow || !p->steady) *wanted = PETSC_FALSE;
  else PetscCall(AccuracyIsWanted(PETSC_TRUE, wanted));
  if (!p->flow || !p->steady || !p->make || p->meshadapt || p->deform || s->nall > BODIES_MAX || InterruptHeard())
    *wanted = PETSC_FALSE;
  for (PetscInt g = 0; g < s->ngroups; g++)
    if (s->group[g].free) *wanted = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The scene, and what else was solved for it */
typedef struct {
  Measured  m[3];
  PetscReal ratio[2]; /* of the cells of each of these to those of the one before; 0: there is no such mesh */
  PetscInt  n;
  Coarser   kept;
} Meshes;

/* Solves by the options as they are now, changed before as *kept says; else puts those after `before` back */
static PetscErrorCode add_solution(const SimComponents *p, PetscInt before, Meshes *s)
{
  SimComponents  other = {.scene = p->scene, .comm = p->comm};
  PetscErrorCode failed;

  PetscFunctionBeginUser;
  LogMute(PETSC_TRUE);
  PetscCall(AgreeBegin(FailureAbort));
  failed = solve_other(p, &other, &s->m[s->n]); /* fails at a body that this mesh does not see, for one */
  PetscCall(AgreeEnd());
  PetscCall((*p->destroy)(&other)); /* as far as it was made */
  LogMute(PETSC_FALSE);
  if (failed) PetscCall(CoarserPutBack(&s->kept, before));
  else s->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_mesh(const SimComponents *p, PetscReal factor, Meshes *s)
{
  const PetscInt before = s->kept.n;

  PetscFunctionBeginUser;
  PetscCall(CoarserMesh(&s->kept, factor, &s->ratio[s->n - 1]));
  if (s->ratio[s->n - 1] > 0) PetscCall(add_solution(p, before, s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is a body too thin for that? */
static PetscErrorCode is_thin(const SimComponents *p, PetscBool *thin)
{
  const MeshLocal *l;
  BodyState       *s;
  PetscReal        cells;

  PetscFunctionBeginUser;
  *thin = PETSC_FALSE;
  PetscCall(MeshGetLocal(p->mesh, &l));
  PetscCall(BodiesGetState(p->bodies, &s));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(PromiseMeasureThickness(l, p->bodies, g, &cells));
    if (cells > 0 && cells < THICK) *thin = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies are drawn, and the mesh could be lined up with them: what the difference leaves out is the error of that */
static PetscErrorCode estimate_drawn(const SimComponents *p, Meshes *s, PetscReal *error)
{
  Subject   subject;
  PetscReal order;
  PetscBool thin;

  PetscFunctionBeginUser;
  *error = -1;
  PetscCall(find_order(p, &order));
  PetscCall(is_thin(p, &thin));
  if (thin) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoarserLineUp(&s->kept));
  s->ratio[0] = 1;
  PetscCall(add_solution(p, 0, s));
  if (s->n < 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_mesh(p, HALF, s));
  PetscCall(choose_subject(p, &s->m[0], &subject));
  *error = differ(&subject, &s->m[0], &s->m[1]);
  if (s->n > 2) *error += differ(&subject, &s->m[1], &s->m[2]) / (PetscPowReal(s->ratio[1], order) - 1);
  *error = PetscMax(ERROR_MIN, *error);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By coarser meshes; where the coarsest does not do, one between tells whether the difference of two is small by chance
   */
static PetscErrorCode estimate_on_meshes(const SimComponents *p, PetscReal order, PetscBool drawn, Meshes *s,
                                         PetscReal *error)
{
  Subject subject;

  PetscFunctionBeginUser;
  *error = -1;
  PetscCall(add_mesh(p, HALF, s));
  if (s->n == 2) PetscCall(add_mesh(p, HALF, s));
  PetscCall(choose_subject(p, &s->m[0], &subject));
  if (s->n > 1) *error = estimate_error(&subject, s->m, s->ratio, s->n, order, drawn);
  if (s->n != 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoarserPutBack(&s->kept, 0));
  PetscCall(add_mesh(p, BETWEEN, s));
  if (s->n > 2)
    *error = PetscMax(*error, differ(&subject, &s->m[0], &s->m[2]) / (PetscPowReal(s->ratio[1], order) - 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyEstimate(const SimComponents *p)
{
  Meshes   *s;
  Subject   subject;
  PetscReal order = 1, error = -1;
  PetscBool wanted, drawn;

  PetscFunctionBeginUser;
  PetscCall(is_wanted(p, &wanted));
  if (!wanted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->n = 1;
  PetscCall(measure(p, &s->m[0]));
  PetscCall(AccuracyFindOrder(p, &order));
  PetscCall(are_drawn(p, &drawn));
  if (drawn) PetscCall(estimate_drawn(p, s, &error));
  if (error < 0) PetscCall(estimate_on_meshes(p, order, drawn, s, &error));
  PetscCall(CoarserPutBack(&s->kept, 0));
  PetscCall(choose_subject(p, &s->m[0], &subject));
  if (error >= 0) {
    PetscCall(AccuracyReport(p, subject.name, error, NULL));
    PetscCall(AccuracyCompare(subject.name, error, NULL, order));
  } else if (s->ratio[0] > 0)
    PetscCall(PetscPrintf(RunComm(), "estimated error: not known, since a mesh half as fine does not do\n"));
  PetscCall(PetscFree(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
