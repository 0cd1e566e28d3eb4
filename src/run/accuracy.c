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
#include "nearby.h"
#include "promise.h"
#include "extrapolate.h"
#include "subject.h"
#include <string.h>

#define CORNERED  1.1  /* order of errors of aligned meshes, at least: with corners (1.09 at 270 degrees, slow) */
#define DRAWN     1.25 /* order of errors: what bodies that are drawn add; aligned meshes, at least and at most */
#define DRAWN_MAX 2.5
#define ORDER_MIN 2.5
#define ORDER_MAX 3.5
#define HALF      2.0 /* cells of a mesh, times those of the one before */
#define THICK     2   /* cells, of a body that a mesh lined up with it tells the truth about */
#define FOLLOWED  2.5 /* likewise, whose outline the mesh follows */
#define BETWEEN   1.5
#define SAME      1.05 /* cells at least so much larger are another mesh */
#define VANISHED  2.0  /* order of errors of corners that are seen on the coarsest mesh alone */
/* Residuals of the other solutions: of linear problems; of those that start from the run's, a correction of Newton's or
   two: what more would change the estimate by up to 6 % (runs/studies/accuracy) */
#define LINEAR_RTOL 1e-6
#define NEAR_RTOL   1e-2
#define ERROR_MIN   2e-5 /* estimate: the difference may vanish where errors do not */

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

/* The run, and the same scene on another mesh */
typedef struct {
  const SimComponents *run, *other;
} Trial;

static PetscErrorCode start_trial(void *ctx)
{
  const Trial *t = (const Trial *)ctx;

  PetscFunctionBeginUser;
  PetscCall(NearbyStart(t->run, t->other));
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

/* By elements of the next order, where a mesh that is lined up follows the outline of its bodies */
static PetscErrorCode estimate_by_order(const SimComponents *p, PetscReal *error, PetscBool *bound)
{
  PetscReal order;
  PetscBool thin;

  PetscFunctionBeginUser;
  *error = -1;
  PetscCall(AccuracyIsThin(p, FOLLOWED, &thin));
  PetscCall(find_order(p, &order));
  if (!thin) PetscCall(AccuracyByOrder(p, (PetscBool)(order < ORDER_MIN), error, bound));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyIsThin(const SimComponents *p, PetscReal limit, PetscBool *thin)
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
    if (cells > 0 && cells < limit) *thin = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* error: NULL, or what the other mesh has, as AccuracyByOrder */
static PetscErrorCode solve_other(const SimComponents *p, SimComponents *other, Measured *m, PetscReal *error)
{
  Trial     trial = {p, other};
  PetscInt  its, linear;
  PetscBool bound;

  PetscFunctionBeginUser;
  PetscCall((*p->make)(other));
  PetscCall(SteadySetTolerance(other->steady, SteadyIsLinear(other->steady) ? LINEAR_RTOL : NEAR_RTOL));
  if (SteadyIsLinear(other->steady)) PetscCall(SteadySetUp(other->steady));
  else PetscCall(SteadySetUpFrom(other->steady, start_trial, &trial));
  PetscCall(SteadySolve(other->steady, &its, &linear));
  PetscCall(CoupleForce(other->couple));
  PetscCall(refuse_prescribed(other->couple));
  PetscCall(SubjectMeasure(other, m));
  if (error) PetscCall(estimate_by_order(other, error, &bound));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest difference of two meshes, of all bodies, as a share of what is judged */
static PetscReal differ(const Subject *s, const Measured *m, const Measured *other)
{
  PetscReal largest = 0;

  for (PetscInt i = 0; i < s->n; i++)
    largest = PetscMax(largest, PetscAbsReal(SubjectValue(s, m, i) - SubjectValue(s, other, i)));
  return largest;
}

/* The scene, and what else was solved for it */
typedef struct {
  Measured   m[4];
  PetscReal  ratio[3]; /* cells of each of these over those of the scene; 0: there is no such mesh */
  PetscInt   n;
  ErrorTrend trend;
  Coarser    kept;
} Meshes;

/* Error on the first mesh by coarser ones, which stand in for elements of the next order; the worst of all bodies */
static PetscReal extrapolate(const Subject *s, const ErrorOrder *order, Meshes *meshes)
{
  PetscReal worst = 0;

  for (PetscInt i = 0; i < s->n; i++) {
    PetscReal  difference[2] = {0, 0}, error;
    ErrorTrend trend;

    for (PetscInt k = 1; k < meshes->n; k++)
      difference[k - 1] = SubjectValue(s, &meshes->m[k], i) - SubjectValue(s, &meshes->m[0], i);
    error = ExtrapolateError(meshes->n - 1, difference, meshes->ratio, order, &trend);
    if (error <= worst) continue;
    worst         = error;
    meshes->trend = trend;
  }
  return worst;
}

/* Of bodies that are drawn where the mesh cannot be lined up: what they add goes by no order, and the coarsest mesh may
   hardly see them */
static PetscReal extrapolate_drawn(const Subject *s, PetscReal order, const Meshes *meshes)
{
  const PetscReal *r     = meshes->ratio;
  PetscReal        first = differ(s, &meshes->m[0], &meshes->m[1]);

  if (meshes->n == 3) {
    const PetscReal a      = PetscPowReal(r[0], DRAWN_MAX),
                    growth = a * (PetscPowReal(r[1] / r[0], DRAWN_MAX) - 1) / (a - 1);

    first = PetscMax(first, PetscMin(2 * first, differ(s, &meshes->m[1], &meshes->m[2]) / growth));
  }
  return first / (PetscPowReal(r[0], order) - 1);
}

/* ---- what is said ---- */

PetscErrorCode AccuracyReport(const SimComponents *p, const char what[], PetscReal error, PetscBool bound,
                              const PetscReal by_source[2])
{
  static const char *const SOURCE[] = {"space", "time"};
  char                     name[64];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(name, sizeof(name), "estimated_error_%s", what));
  PetscCall(MonitorQuantity(p->monitor, name, error));
  PetscCall(
    PetscPrintf(RunComm(), "estimated error of %s: %s%.2g %%", what, bound ? "at most " : "", (double)(100 * error)));
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
  PetscInt  preset;
  PetscReal promised;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-preset", name, sizeof(name)));
  if (!name[0]) PetscFunctionReturn(PETSC_SUCCESS);
  preset   = PromiseFind(name);
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
  if (!p->flow || !p->steady || !p->make || p->deform || s->nall > SUBJECT_BODIES || InterruptHeard())
    *wanted = PETSC_FALSE;
  for (PetscInt g = 0; g < s->ngroups; g++)
    if (s->group[g].free) *wanted = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solves by the options as they are now, changed before as *kept says; else puts those after `before` back */
static PetscErrorCode add_solution(const SimComponents *p, PetscInt before, Meshes *s, PetscReal *error)
{
  SimComponents  other = {.scene = p->scene, .comm = p->comm};
  PetscErrorCode failed;

  PetscFunctionBeginUser;
  LogMute(PETSC_TRUE);
  PetscCall(AgreeBegin(FailureAbort));
  failed = solve_other(p, &other, &s->m[s->n], error); /* fails at a body that this mesh does not see, for one */
  PetscCall(AgreeEnd());
  PetscCall((*p->destroy)(&other)); /* as far as it was made */
  LogMute(PETSC_FALSE);
  if (failed) PetscCall(CoarserPutBack(&s->kept, before));
  else s->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* On cells larger by that factor than the options say now, unless that mesh was solved on */
static PetscErrorCode add_mesh(const SimComponents *p, PetscReal factor, Meshes *s)
{
  const PetscInt  before = s->kept.n;
  const PetscReal last   = s->n > 1 && before > 0 ? s->ratio[s->n - 2] : 1;
  PetscReal       ratio;

  PetscFunctionBeginUser;
  PetscCall(CoarserMesh(&s->kept, factor, &ratio));
  s->ratio[s->n - 1] = ratio * last;
  if (ratio == 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->n > 1 && s->ratio[s->n - 1] < SAME * s->ratio[s->n - 2]) PetscCall(CoarserPutBack(&s->kept, before));
  else PetscCall(add_solution(p, before, s, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies are drawn, and the mesh could be lined up with them: what the difference leaves out is the error of that */
static PetscErrorCode estimate_drawn(const SimComponents *p, Meshes *s, PetscReal *error)
{
  Subject   subject;
  PetscReal order, lined_up = -1;
  PetscBool thin;

  PetscFunctionBeginUser;
  *error = -1;
  PetscCall(find_order(p, &order));
  PetscCall(AccuracyIsThin(p, THICK, &thin));
  if (thin) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoarserLineUp(&s->kept));
  s->ratio[0] = 1;
  PetscCall(add_solution(p, 0, s, &lined_up));
  if (s->n < 2) PetscFunctionReturn(PETSC_SUCCESS);
  if (lined_up < 0) PetscCall(add_mesh(p, HALF, s));
  PetscCall(SubjectChoose(p, &s->m[0], &subject));
  *error = differ(&subject, &s->m[0], &s->m[1]) + PetscMax(0, lined_up);
  if (s->n > 2) *error += differ(&subject, &s->m[1], &s->m[2]) / (PetscPowReal(s->ratio[1], order) - 1);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By coarser meshes: of drawn bodies half and a quarter as fine, else two thirds and half as fine */
static PetscErrorCode estimate_on_meshes(const SimComponents *p, PetscReal order, PetscBool drawn, Meshes *s,
                                         PetscReal *error)
{
  const ErrorOrder smooth = {ORDER_MIN, ORDER_MAX, ORDER_MAX}, cornered = {CORNERED, ORDER_MAX, VANISHED};
  Subject          subject;

  PetscFunctionBeginUser;
  *error = -1;
  PetscCall(SubjectChoose(p, &s->m[0], &subject));
  PetscCall(add_mesh(p, drawn ? HALF : BETWEEN, s));
  if (!drawn) {
    PetscCall(CoarserPutBack(&s->kept, 0));
    PetscCall(add_mesh(p, HALF, s));
  }
  if (s->n == 2 && s->ratio[0] * SAME >= HALF) { /* that is all there is: one half as fine as it */
    PetscReal half;

    PetscCall(CoarserPutBack(&s->kept, 0));
    PetscCall(CoarserMesh(&s->kept, HALF, &half));
    PetscCall(add_mesh(p, HALF, s));
  }
  if (s->n > 1 && drawn) *error = extrapolate_drawn(&subject, order, s);
  else if (s->n > 1) *error = extrapolate(&subject, order < ORDER_MIN ? &cornered : &smooth, s);
  if (s->n != 3 || drawn || order >= ORDER_MIN || s->trend != TREND_STALLS) PetscFunctionReturn(PETSC_SUCCESS);
  /* corners whose errors come and go with the places of nodes: as large as values of any two meshes differ */
  PetscCall(CoarserPutBack(&s->kept, 0));
  PetscCall(add_mesh(p, HALF * HALF, s));
  for (PetscInt i = 0; i < s->n; i++)
    for (PetscInt j = 0; j < i; j++)
      *error = PetscMax(*error, differ(&subject, &s->m[i], &s->m[j]) / (PetscPowReal(HALF, order) - 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyEstimate(const SimComponents *p)
{
  Meshes   *s;
  Subject   subject;
  PetscReal order = 1, error = -1;
  PetscBool wanted, drawn, bound = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(is_wanted(p, &wanted));
  if (!wanted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->n = 1;
  PetscCall(SubjectMeasure(p, &s->m[0]));
  PetscCall(AccuracyFindOrder(p, &order));
  PetscCall(are_drawn(p, &drawn));
  if (drawn) PetscCall(estimate_drawn(p, s, &error));
  else PetscCall(estimate_by_order(p, &error, &bound));
  if (error < 0 && !p->meshadapt) {
    PetscCall(estimate_on_meshes(p, order, drawn, s, &error));
    bound = (PetscBool)(s->trend != TREND_CONVERGES);
  }
  if (error >= 0) error = PetscMax(ERROR_MIN, error);
  PetscCall(CoarserPutBack(&s->kept, 0));
  PetscCall(SubjectChoose(p, &s->m[0], &subject));
  if (error >= 0) {
    PetscCall(AccuracyReport(p, subject.name, error, bound, NULL));
    PetscCall(AccuracyCompare(subject.name, error, NULL, order));
  } else if (s->ratio[0] > 0)
    PetscCall(PetscPrintf(RunComm(), "estimated error: not known, since a mesh half as fine does not do\n"));
  PetscCall(PetscFree(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
