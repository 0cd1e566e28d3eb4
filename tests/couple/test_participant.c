/* Participants of a step: one of the test's own counts its calls, adds a known force, limits the step, has a state that
   survives a checkpoint, and sees a change of the mesh. */
/* ranks: 1 2 3 */
#include "core.h"
#include "calls.h"
#include "couple/participant.h"
#include "mesh/carry.h"
#include "mesh/state.h"
#include "raised.h"
#include "impl.h"

#define CAVITY \
  "-mesh_refine_distance 1 -mesh_levels 2 -mesh_cells 8,8 -flow_density 1.3 -flow_viscosity 0.05 -flow_gravity 0.5,-9 -flow_ksp_rtol 1e-11 " \
  "-flow_ksp_max_it 300 -particle_groups disc -particle_disc_shape circle -particle_disc_radius 0.2 -particle_disc_density 2 " \
  "-particle_disc_position 0.45,0.5 "

/* Pushes the lower half of the domain */
typedef struct {
  Flow       flow;
  Mesh       mesh;
  PetscInt   n[NCALLS], order[NCALLS], ncalls; /* first calls in their order */
  PetscReal *f, push[2], sum[2];               /* nodal force; per mass; over all ranks */
  PetscReal  taken;                            /* time of the steps taken: its state */
  FlowSolver solver;
  PetscBool  kept, old; /* from a mesh to the next; was the old one given? */
} Pusher;

static void count(Pusher *w, PetscInt call)
{
  if (!w->n[call]++) w->order[w->ncalls++] = call;
}

#define COUNTED(name, call) \
  static PetscErrorCode name(Couple couple, void *part) \
  { \
    (void)couple; \
    count((Pusher *)part, call); \
    return PETSC_SUCCESS; \
  }

COUNTED(begin, BEGIN)
COUNTED(prepare, PREPARE)
COUNTED(rows, ROWS)
COUNTED(assemble, ASSEMBLE)
COUNTED(start, START)
COUNTED(solved, SOLVED)
COUNTED(force, FORCE)

static PetscErrorCode balance(Couple couple, void *part, const FlowDiagnostics *d, CoupleBalance *b)
{
  Pusher *w = (Pusher *)part;

  (void)couple;
  (void)d;
  count(w, BALANCE);
  for (PetscInt a = 0; a < 2; a++) {
    b->others[a] += w->sum[a];
    b->residual[a] -= w->sum[a];
    b->size += PetscAbsReal(w->sum[a]);
  }
  return PETSC_SUCCESS;
}

static PetscErrorCode energy(Couple couple, void *part, CouplePower *power)
{
  (void)couple;
  count((Pusher *)part, ENERGY);
  power->power += 1000;
  return PETSC_SUCCESS;
}

static PetscErrorCode limit(Couple couple, void *part, PetscReal *dt)
{
  (void)couple;
  count((Pusher *)part, LIMIT);
  *dt = PetscMin(*dt, 0.015);
  return PETSC_SUCCESS;
}

static PetscErrorCode advance(Couple couple, void *part)
{
  Pusher         *w = (Pusher *)part;
  const FlowStep *step;

  (void)couple;
  count(w, ADVANCE);
  OK(FlowGetStep(w->flow, &step));
  w->taken += step->dt;
  return PETSC_SUCCESS;
}

static PetscErrorCode connect_solver(Couple couple, void *part, FlowSolver solver)
{
  (void)couple;
  count((Pusher *)part, CONNECT);
  ((Pusher *)part)->solver = solver;
  return PETSC_SUCCESS;
}

static PetscErrorCode leave(Couple couple, void *part)
{
  (void)couple;
  count((Pusher *)part, LEAVE);
  ((Pusher *)part)->kept = PETSC_TRUE;
  return PETSC_SUCCESS;
}

static PetscErrorCode discard(Couple couple, void *part)
{
  (void)couple;
  count((Pusher *)part, DISCARD);
  OK(PetscFree(((Pusher *)part)->f));
  return PETSC_SUCCESS;
}

static PetscErrorCode arrive(Couple couple, void *part, Mesh *old)
{
  Pusher          *w = (Pusher *)part;
  const MeshLocal *l;
  const PetscReal *m;

  (void)couple;
  count(w, ARRIVE);
  w->old = (PetscBool)(old && *old);
  OK(MeshGetLocal(w->mesh, &l));
  OK(FlowGetLumpedMass(w->flow, &m));
  OK(PetscCalloc1(2 * l->nnode_all, &w->f));
  for (PetscInt a = 0; a < 2; a++) {
    w->sum[a] = 0;
    for (PetscInt i = 0; i < l->nnode; i++) {
      const PetscReal *x    = l->x + 2 * i;
      const PetscBool  wall = (PetscBool)(x[0] < 1e-9 || x[0] > 1 - 1e-9 || x[1] < 1e-9); /* which would take it */

      w->f[2 * i + a] = x[1] < 0.5 && !wall ? m[i] * w->push[a] : 0;
      w->sum[a] += w->f[2 * i + a];
    }
    w->sum[a] = total(w->sum[a]);
  }
  OK(FlowAddForce(w->flow, w, w->f));
  return PETSC_SUCCESS;
}

static PetscErrorCode visit(Couple couple, void *part, State state)
{
  Pusher *w = (Pusher *)part;

  (void)couple;
  count(w, VISIT);
  OK(StateReals(state, "pusher_taken", 1, &w->taken));
  if (StateIsLoading(state)) OK(CoupleNeedsSolver(couple));
  return PETSC_SUCCESS;
}

static PetscErrorCode view(Couple couple, void *part, PetscViewer viewer)
{
  (void)couple;
  (void)viewer;
  count((Pusher *)part, VIEW);
  return PETSC_SUCCESS;
}

COUNTED(destroy, DESTROY)

static const CoupleParticipant PUSHER = {.name          = "pusher",
                                         .begin         = begin,
                                         .prepare       = prepare,
                                         .rows          = rows,
                                         .assemble      = assemble,
                                         .start         = start,
                                         .solved        = solved,
                                         .force         = force,
                                         .balance       = balance,
                                         .energy        = energy,
                                         .limit         = limit,
                                         .advance       = advance,
                                         .connect       = connect_solver,
                                         .before_remesh = leave,
                                         .discard       = discard,
                                         .after_remesh  = arrive,
                                         .visit         = visit,
                                         .view          = view,
                                         .destroy       = destroy};

static PetscErrorCode point_distance(void *context, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  const PetscReal *at = context;

  (void)reach;
  *d = PetscSqrtReal(PetscSqr(x[0] - at[0]) + PetscSqr(x[1] - at[1]));
  return PETSC_SUCCESS;
}

/* A step; its balance closes, and has the force of the pusher if there is one */
static void take_step(Couple couple, Flow flow, const Pusher *w, PetscReal time, PetscReal dt)
{
  const PetscReal   *u, *p;
  PetscInt           its;
  KSPConvergedReason reason;
  FlowDiagnostics    d;
  CoupleBalance      b;

  OK(FlowBeginStep(flow, time, dt));
  OK(CoupleUpdateGeometry(couple));
  OK(CoupleSolve(couple, &its, &reason));
  assert_true(reason > 0);
  OK(CoupleForce(couple));
  OK(CoupleGetSolution(couple, &u, &p));
  OK(FlowDiagnose(flow, u, NULL, &d));
  OK(CoupleMomentum(couple, &d, &b));
  BELOW(b.error, 1e-8);
  for (PetscInt a = 0; a < 2; a++) {
    NEAR(b.others[a], w->sum[a], 1e-14);
    NEAR(b.fluid[a], b.walls[a] + b.bodies[a] + b.openings[a] + b.volume[a] + w->sum[a], 1e-7 * b.size);
  }
  assert_true(PetscAbsReal(w->sum[0]) > 0.05 * b.size); /* or it would close without it */
  OK(CoupleAdvance(couple));
}

static void carry_state(Mesh mesh, Couple couple, PetscBool load)
{
  const char path[] = "participant.h5";
  State      s;

  OK(MeshCreateState(mesh, &s));
  OK(load ? StateBeginLoad(s, path) : StateBeginSave(s, path));
  OK(StateModule(s, "couple"));
  OK(CoupleVisitState(couple, s));
  OK(StateEnd(s));
  OK(StateDestroy(&s));
  if (load) (void)remove(path); /* the first rank to come does */
}

static void test_participant(void **state)
{
  PetscReal        at[3] = {0.2, 0.2, 0}, to[3] = {0.8, 0.7, 0}, dt = 1;
  Pusher           w    = {.push = {3, -2}};
  int              lost = 0, drained = 0;
  PetscReal       *density, *rhs;
  const char      *who;
  const MeshLocal *l;
  Mesh             old;
  Bodies           bodies;
  Couple           couple;
  CouplePower      power[2];
  FlowSolver       solver, first;

  (void)state;
  give(CAVITY);
  OK(MeshCreateAround(PETSC_COMM_WORLD, &(MeshSurface){.distance = point_distance, .context = at}, &w.mesh));
  OK(MeshGetLocal(w.mesh, &l));
  OK(FlowCreate(w.mesh, &w.flow));
  OK(BodiesCreate(2, l->lower, l->upper, &bodies));
  OK(CoupleCreate(w.flow, bodies, &couple));
  OK(CoupleLimitStep(couple, &dt, &who));
  assert_true(dt == 1 && !who);
  OK(CoupleGetPower(couple, &power[0]));
  OK(CoupleAddParticipant(couple, &PUSHER, &w));
  assert_true(w.n[CONNECT] == 1 && w.n[ARRIVE] == 1 && !w.old);
  OK(CoupleGetPower(couple, &power[1]));
  NEAR(power[1].power, power[0].power + 1000, 1e-12);

  OK(CoupleLimitStep(couple, &dt, &who));
  assert_true(dt == 0.015);
  assert_string_equal(who, "pusher");
  dt = 0.01;
  OK(CoupleLimitStep(couple, &dt, &who));
  assert_true(dt == 0.01 && !who);

  take_step(couple, w.flow, &w, dt, dt);
  take_step(couple, w.flow, &w, 2 * dt, dt);
  for (PetscInt i = BEGIN; i <= ADVANCE; i++) assert_int_equal(w.n[i], i == ENERGY ? 1 : i == LIMIT ? 2 : 2);
  for (PetscInt i = 0, before = -1; i < w.ncalls; i++) { /* those of a step come in the order of the table */
    if (w.order[i] > ADVANCE || w.order[i] == ENERGY || w.order[i] == LIMIT) continue;
    assert_true(w.order[i] > before);
    before = w.order[i];
  }
  NEAR(w.taken, 2 * dt, 1e-14);

  /* a checkpoint, and the solver that it makes anew */
  carry_state(w.mesh, couple, PETSC_FALSE);
  w.taken = -1;
  first   = w.solver;
  assert_int_equal(w.n[CONNECT], 1);
  carry_state(w.mesh, couple, PETSC_TRUE);
  NEAR(w.taken, 2 * dt, 1e-14);
  assert_int_equal(w.n[VISIT], 2);
  assert_int_equal(w.n[CONNECT], 2);
  OK(CoupleGetSolver(couple, &solver));
  assert_true(first && w.solver == solver);

  /* another mesh; whoever had something on the old one, and does not say what becomes of it, is an error */
  OK(FlowAddForce(w.flow, &lost, w.f));
  OK(FlowAddVolume(w.flow, &drained, &(FlowVolume){0}));
  OK(PetscMalloc1(l->ncell_all, &density));
  for (PetscInt c = 0; c < l->ncell_all; c++) density[c] = 1.3;
  OK(FlowSetProperties(w.flow, density, NULL));
  OK(CoupleBeforeRemesh(couple));
  OK(MeshRemesh(w.mesh, &(MeshSurface){.distance = point_distance, .context = to}, &old));
  OK(FlowRemesh(w.flow, old));
  OK(CoupleAfterRemesh(couple, &old));
  OK(MeshDestroy(&old));
  assert_true(w.n[LEAVE] == 1 && w.n[DISCARD] == 1 && w.n[ARRIVE] == 2 && w.n[CONNECT] == 3);
  assert_true(w.kept && w.old);
  OK(MeshGetLocal(w.mesh, &l));
  OK(PetscMalloc1(2 * l->nnode_all, &rhs));
  begin_error();
  expect_error(FlowRhs(w.flow, rhs), PETSC_ERR_ORDER, "2 owner(s) of terms", NULL);
  OK(FlowAddForce(w.flow, &lost, NULL));
  begin_error();
  expect_error(FlowRhs(w.flow, rhs), PETSC_ERR_ORDER, "1 owner(s) of terms", NULL);
  OK(FlowAddVolume(w.flow, &drained, NULL));
  begin_error();
  expect_error(FlowRhs(w.flow, rhs), PETSC_ERR_ORDER, "call FlowSetProperties again", NULL);
  OK(FlowSetProperties(w.flow, NULL, NULL));
  OK(PetscFree(rhs));
  OK(PetscFree(density));
  take_step(couple, w.flow, &w, 3 * dt, dt);
  NEAR(w.taken, 3 * dt, 1e-14);
  OK(CoupleView(couple, PETSC_VIEWER_STDOUT_WORLD));
  assert_int_equal(w.n[VIEW], 1);

  OK(CoupleDestroy(&couple));
  assert_true(w.n[DISCARD] == 2 && w.n[DESTROY] == 1);
  OK(BodiesDestroy(&bodies));
  OK(FlowDestroy(&w.flow));
  OK(MeshDestroy(&w.mesh));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_participant)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("participant", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
