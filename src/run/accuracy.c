/* Accuracy: see accuracy.h. */
#include "compat.h"
#include "accuracy.h"
#include "base/agree.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "failure.h"
#include "promise.h"
#include <stdlib.h>
#include <string.h>

#define MOST_BODIES 64
#define LEAST_CELLS 4    /* along an axis, which a mesh half as fine is made of */
#define DRAWN       1.25 /* order of errors: what bodies that are drawn add; aligned meshes, at least and at most */
#define MOST_DRAWN  2.5
#define LEAST_ORDER 2.5
#define MOST_ORDER  3.5
#define LEAST       2e-5 /* estimate: the difference may vanish where errors do not */

/* What is measured on a mesh */
typedef struct {
  PetscReal force[3 * MOST_BODIES], velocity[3], energy; /* mean velocity of the fluid */
} Measured;

/* An option as it was, to be put back */
typedef struct {
  char      name[64], was[256];
  PetscBool given;
} Kept;

/* ---- a mesh half as fine ---- */

static PetscErrorCode change(Kept *k, const char name[], const char text[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(k->name, name, sizeof(k->name)));
  PetscCall(PetscOptionsHasName(NULL, NULL, name, &k->given));
  PetscCall(OptPeek(name, k->was, sizeof(k->was)));
  PetscCall(PetscOptionsSetValue(NULL, name, text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode put_back(const Kept *k)
{
  PetscFunctionBeginUser;
  if (k->given) PetscCall(PetscOptionsSetValue(NULL, k->name, k->was));
  else PetscCall(PetscOptionsClearValue(NULL, k->name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* "44,8" -> "22,4", and by how much cells become larger; 0: too few */
static void halve(const char cells[], PetscInt least, char half[], size_t len, PetscReal *ratio)
{
  PetscInt n = 0;

  *ratio  = 1;
  half[0] = 0;
  for (const char *at = cells; *at; at += strspn(at, ", ")) {
    char      *end;
    const long now = strtol(at, &end, 10), then = (now + 1) / 2;
    size_t     used = strlen(half);

    if (end == at || now < least) *ratio = 0;
    if (*ratio == 0) return;
    (void)snprintf(half + used, len - used, "%s%ld", n ? "," : "", then);
    *ratio *= (PetscReal)now / (PetscReal)then;
    n++;
    at = end;
  }
  *ratio = n ? PetscPowReal(*ratio, 1. / (PetscReal)n) : 0;
}

/* *ratio 0: there is no such mesh */
static PetscErrorCode coarsen(Kept *kept, PetscReal *ratio)
{
  char      kind[64], text[64], half[128];
  PetscInt  refined = 0;
  PetscReal h;
  PetscBool file, box, found;

  PetscFunctionBeginUser;
  *ratio = 2;
  PetscCall(PetscOptionsGetInt(NULL, NULL, "-dm_refine", &refined, NULL));
  PetscCall(PetscSNPrintf(half, sizeof(half), "%" PetscInt_FMT, refined - 1));
  if (refined > 0) PetscCall(change(kept, "-dm_refine", half));
  if (refined > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptPeek("-mesh_kind", kind, sizeof(kind)));
  PetscCall(PetscStrcasecmp(kind, "file", &file));
  PetscCall(PetscStrcasecmp(kind[0] ? kind : "box", "box", &box));
  PetscCall(OptPeekReal("-mesh_focus_h", &h, &found));
  if (box && found) {
    (void)snprintf(half, sizeof(half), "%.17g", (double)(2 * h));
    PetscCall(change(kept, "-mesh_focus_h", half));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(OptPeek(box ? "-mesh_cells" : "-mesh_resolution", text, sizeof(text)));
  if (!box && !text[0]) PetscCall(PetscSNPrintf(text, sizeof(text), "%" PetscInt_FMT, MeshDefaultResolution(kind)));
  halve(text, box ? LEAST_CELLS : 2, half, sizeof(half), ratio);
  if (file) *ratio = 0;
  if (*ratio > 0) PetscCall(change(kept, box ? "-mesh_cells" : "-mesh_resolution", half));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- two meshes ---- */

/* After CoupleForce. Collective. */
static PetscErrorCode measure(const SimParts *p, Measured *m)
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
  PetscCall(FlowDiagnose(p->flow, u, &d));
  m->energy = d.kinetic_energy;
  for (PetscInt a = 0; a < 3; a++) m->velocity[a] = d.volume > 0 ? d.velocity[a] / d.volume : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve_other(const SimParts *p, SimParts *other, Measured *m)
{
  PetscInt its, linear;

  PetscFunctionBeginUser;
  PetscCall((*p->make)(other));
  PetscCall(SteadySetUp(other->steady));
  PetscCall(SteadySolve(other->steady, &its, &linear));
  PetscCall(CoupleForce(other->couple));
  PetscCall(measure(other, m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Order of the error, on the low side */
static PetscErrorCode find_order(const SimParts *p, PetscReal *order)
{
  BodyState *s;
  char       method[64];
  PetscBool  drawn = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &s));
  for (PetscInt g = 0; g < s->ngroups; g++) drawn = (PetscBool)(drawn || (s->group[g].count && !s->group[g].hole));
  PetscCall(OptPeek("-couple_boundary", method, sizeof(method)));
  *order = !drawn || !strcasecmp(method, "snap") ? LEAST_ORDER : DRAWN;
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

static PetscErrorCode choose_subject(const SimParts *p, const Measured *m, Subject *s)
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
  PetscReal most = 0;

  for (PetscInt i = 0; i < s->n; i++) most = PetscMax(most, PetscAbsReal((*s->of)(m, s->axis + 3 * i) - (*s->of)(other, s->axis + 3 * i)));
  return s->size > 0 ? most / s->size : 0;
}

/* Difference of the second and the third of three meshes beside that of the first two, of an error of that order */
static PetscReal get_growth(const PetscReal ratio[], PetscReal order)
{
  const PetscReal first = PetscPowReal(ratio[0], order);

  return first * (PetscPowReal(ratio[1], order) - 1) / (first - 1);
}

/* Error on the finest of n meshes. Of three the order is seen, within bounds; the difference of the two finest may be
   small by chance, but not beside that of the others. What bodies that are drawn add goes by no order. */
static PetscReal judge(const Subject *s, const Measured m[], const PetscReal ratio[], PetscInt n, PetscReal order)
{
  const PetscBool drawn = (PetscBool)(order < LEAST_ORDER);
  PetscReal       first = differ(s, &m[0], &m[1]), before, low = order, high = MOST_ORDER;

  if (n == 3) {
    before = differ(s, &m[1], &m[2]);
    /* where bodies are drawn the third mesh may hardly see them */
    if (drawn) first = PetscMax(first, PetscMin(2 * first, before / get_growth(ratio, MOST_DRAWN)));
    else first = PetscMax(first, before / get_growth(ratio, MOST_ORDER));
    for (PetscInt i = 0; i < 30 && !drawn; i++) {
      order = 0.5 * (low + high);
      if (get_growth(ratio, order) * first < before) low = order;
      else high = order;
    }
  }
  return PetscMax(LEAST, first / (PetscPowReal(ratio[0], order) - 1));
}

/* ---- what is said ---- */

static PetscErrorCode say(const SimParts *p, const char what[], PetscReal error, PetscReal order)
{
  char      name[64], text[64];
  PetscInt  preset = 1;
  PetscReal promised;

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(name, sizeof(name), "estimated_error_%s", what));
  PetscCall(MonitorQuantity(p->monitor, name, error));
  (void)snprintf(text, sizeof(text), "%.2g", (double)(100 * error));
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "estimated error of %s: %s %%\n", what, text));
  PetscCall(OptPeek("-preset", name, sizeof(name)));
  if (!name[0]) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; PROMISE_PRESETS[i]; i++)
    if (!strcasecmp(name, PROMISE_PRESETS[i])) preset = i;
  promised = 0.01 * PromisePercent(preset);
  if (error <= promised) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    LogRemark("-preset %s promises %g %%, and the estimated error of %s on this mesh is %s %%: refine it, about %.1f times as many cells along each "
              "axis keep the promise (-mesh_cells, -mesh_resolution, -mesh_levels), or let the flow choose them (-mesh_adapt)",
              PROMISE_PRESETS[preset], (double)(100 * promised), what, text, (double)PetscPowReal(error / promised, 1 / order)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyIsWanted(PetscBool *wanted)
{
  char preset[64];

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-preset", preset, sizeof(preset)));
  *wanted = (PetscBool)(preset[0] != 0);
  PetscCall(OptBool("-monitor_accuracy", wanted));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode is_wanted(const SimParts *p, PetscBool *wanted)
{
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(p->bodies, &s));
  if (!p->flow || !p->steady) *wanted = PETSC_FALSE;
  else PetscCall(AccuracyIsWanted(wanted));
  if (!p->flow || !p->steady || !p->make || p->meshadapt || p->deform || s->nall > MOST_BODIES || InterruptHeard()) *wanted = PETSC_FALSE;
  for (PetscInt g = 0; g < s->ngroups; g++)
    if (s->group[g].free) *wanted = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solves on one mesh more, half as fine as the one of the options; *n: how many there are then */
static PetscErrorCode add_mesh(const SimParts *p, Measured m[], PetscReal ratio[], Kept kept[], PetscInt *n)
{
  SimParts       other = {.scene = p->scene};
  PetscErrorCode failed;

  PetscFunctionBeginUser;
  PetscCall(coarsen(&kept[*n - 1], &ratio[*n - 1]));
  if (ratio[*n - 1] == 0) PetscFunctionReturn(PETSC_SUCCESS);
  LogMute(PETSC_TRUE);
  PetscCall(AgreeBegin(FailureAbort));
  failed = solve_other(p, &other, &m[*n]); /* fails at a body that this mesh does not see, for one */
  PetscCall(AgreeEnd());
  PetscCall((*p->destroy)(&other)); /* as far as it was made */
  LogMute(PETSC_FALSE);
  if (failed) PetscCall(put_back(&kept[*n - 1]));
  else (*n)++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyEstimate(const SimParts *p)
{
  Measured *m;
  Kept      kept[2];
  Subject   subject;
  PetscReal ratio[2] = {0, 0}, order = 1;
  PetscInt  n = 1;
  PetscBool wanted;

  PetscFunctionBeginUser;
  PetscCall(is_wanted(p, &wanted));
  if (!wanted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(3, &m));
  PetscCall(measure(p, &m[0]));
  PetscCall(find_order(p, &order));
  for (PetscInt k = 1; k < 3 && n == k; k++) PetscCall(add_mesh(p, m, ratio, kept, &n));
  for (PetscInt k = n - 1; k-- > 0;) PetscCall(put_back(&kept[k]));
  PetscCall(choose_subject(p, &m[0], &subject));
  if (n > 1) PetscCall(say(p, subject.name, judge(&subject, m, ratio, n, order), order));
  else if (ratio[0] > 0) PetscCall(PetscPrintf(PETSC_COMM_WORLD, "estimated error: not known, since a mesh half as fine does not do\n"));
  PetscCall(PetscFree(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}
