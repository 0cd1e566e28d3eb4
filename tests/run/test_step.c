/* How long a step is and what is believed of it: the controller against the local errors of its schemes, its limits;
   every sign of the judge on states made up for it, and none on sound ones; what of a contact's force counts as a
   load. */
/* ranks: 2 */
#include "adapt.h"
#include "couple/participant.h"
#include "bodies/write.h"
#include "core.h"
#include "stepcheck.h"
#include "contactphase.h"
#include "raised.h"

typedef struct {
  Mesh                  mesh;
  Flow                  flow;
  Bodies                bodies;
  Couple                couple;
  Contact               contact;
  Monitor               monitor;
  Limits                limits;
  Adapt                 adapt;
  StepCheck             check;
  BodyArrays           *s;
  const MeshLocal      *l;
  const FlowParameters *par;
  PetscReal             t;
} Case;

static void open_case(Case *c, const char options[], const char more[], PetscReal dt)
{
  char text[1024];

  snprintf(text, sizeof(text), "-mesh_cells 4,4 %s %s", options, more);
  give(text);
  c->t = 0;
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(FlowGetParameters(c->flow, &c->par));
  OK(BodiesCreate(c->l->dim, c->l->lower, c->l->upper, &c->bodies));
  OK(BodiesGetArrays(c->bodies, &c->s));
  OK(CoupleCreate(c->flow, c->bodies, &c->couple));
  OK(ContactCreate(c->bodies, c->l->h, c->par->density, c->par->gravity, c->l->lower, c->l->upper, 15, &c->contact));
  OK(MonitorCreate(PETSC_COMM_WORLD, c->bodies, &c->monitor));
  OK(LimitsCreate(&c->limits));
  OK(AdaptCreate(c->flow, c->bodies, c->couple, c->contact, c->monitor, c->limits, dt, &c->adapt));
  OK(StepCheckCreate(c->flow, c->bodies, c->couple, c->limits, &c->check));
}

static void close_case(Case *c)
{
  OK(StepCheckDestroy(&c->check));
  OK(AdaptDestroy(&c->adapt));
  OK(LimitsDestroy(&c->limits));
  OK(MonitorDestroy(&c->monitor));
  OK(ContactDestroy(&c->contact));
  OK(CoupleDestroy(&c->couple));
  OK(BodiesDestroy(&c->bodies));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* ---- how long a step is ---- */

#define ADAPT "-sim_adapt -sim_adapt_cfl 0 -sim_adapt_min 1e-6 -sim_adapt_speed 1 -mesh_periodic x,y "
#define AGAIN 1e9 /* no time to hit */

/* The whole fluid goes at t^m: a step to t + dt that solves for it, exactly but for the error that the scheme makes
   from exact values before; returns the size of that */
static PetscReal solve_step(Case *c, PetscInt m, PetscReal dt)
{
  const FlowStep *s;
  PetscReal      *u, y;

  OK(FlowBeginStep(c->flow, c->t + dt, dt));
  OK(CoupleUpdateGeometry(c->couple));
  OK(FlowGetStep(c->flow, &s));
  OK(CoupleGetSystem(c->couple, &u, NULL, NULL, NULL, NULL));
  y = (s->theta * m * PetscPowReal(c->t + dt, m - 1) + (1 - s->theta) * m * PetscPowReal(c->t, m - 1) +
       s->d0 * PetscPowReal(c->t, m) + s->d1 * PetscPowReal(c->t - s->dt_old, m)) /
      s->ct;
  for (PetscInt i = 0; i < c->l->nnode_all * 2; i++) u[i] = i % 2 ? 0 : y;
  return PetscAbsReal(y - PetscPowReal(c->t + dt, m));
}

/* Is it good? */
static PetscBool try_step(Case *c, PetscInt m, PetscReal dt, PetscReal *error, KSPConvergedReason reason)
{
  PetscBool good;

  *error = solve_step(c, m, dt);
  OK(AdaptCheck(c->adapt, reason, &good));
  return good;
}

/* It is accepted, and the flow has the exact values */
static void take_step(Case *c, PetscInt m, PetscReal dt, PetscReal cfl)
{
  PetscReal *u, *p;

  OK(AdaptAccept(c->adapt, cfl));
  c->t += dt;
  OK(PetscCalloc2(c->l->nnode_all * 2, &u, c->l->ncell * 3, &p));
  for (PetscInt i = 0; i < c->l->nnode_all * 2; i += 2) u[i] = PetscPowReal(c->t, m);
  OK(FlowAcceptStep(c->flow, u, p));
  OK(PetscFree2(u, p));
}

static PetscReal next_step(Case *c)
{
  PetscReal dt;
  PetscBool hits;

  OK(AdaptGetStep(c->adapt, c->t, AGAIN, &dt, &hits));
  assert_false(hits);
  return dt;
}

/* Whose word is the length of that? */
static const char *holder(Case *c)
{
  PetscInt row;

  OK(LimitsGetDeciding(c->limits, &row, NULL));
  return LimitsName(c->limits, row);
}

/* Some steps of unequal lengths, which nobody judges */
static void begin(Case *c, PetscInt m)
{
  static const PetscReal length[] = {0.1, 0.12, 0.09, 0.11};

  for (PetscInt i = 0; i < 4; i++) {
    (void)solve_step(c, m, length[i]);
    take_step(c, m, length[i], 0);
  }
}

static const struct {
  const char *option;
  PetscInt    m, order;
} SCHEME[] = {{"-flow_time be", 2, 1}, {"-flow_time cn", 3, 2}, {"-flow_time bdf2", 3, 2}};

/* The next step is 0.9 (T/e)^(1/(order + 1)) times this one, e the local error, which is found exactly where the
   solution is a polynomial of the next degree; that is what a first try with any tolerance shows */
static void test_error_sets_the_step(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < 3; i++)
    for (PetscInt k = 0; k < 2; k++) { /* longer, shorter */
      const PetscReal dt = 0.1, want = k ? 0.8 : 1.3;
      Case            c;
      PetscReal       error, tolerance;
      char            more[256];

      open_case(&c, ADAPT, SCHEME[i].option, 0.1);
      begin(&c, SCHEME[i].m);
      (void)try_step(&c, SCHEME[i].m, dt, &error, 1);
      close_case(&c);
      tolerance = error * PetscPowReal(want / 0.9, SCHEME[i].order + 1);
      snprintf(more, sizeof(more), "-sim_adapt_tolerance %.17g %s", (double)tolerance, SCHEME[i].option);
      open_case(&c, ADAPT, more, 0.1);
      begin(&c, SCHEME[i].m);
      assert_true(try_step(&c, SCHEME[i].m, dt, &error, 1));
      take_step(&c, SCHEME[i].m, dt, 0);
      NEAR(next_step(&c), want * dt, 1e-9);
      close_case(&c);
    }
}

/* Beyond twice the tolerance it is taken again, at least a fifth as long; not if it is the shortest */
static void test_rejected(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    Case      c;
    PetscReal error;

    open_case(&c, ADAPT "-flow_time be -sim_adapt_tolerance 1e-7", k ? "-sim_adapt_min 0.1" : "", 0.1);
    begin(&c, 2);
    assert_int_equal(try_step(&c, 2, 0.1, &error, 1), k);
    if (!k) NEAR(next_step(&c), 0.2 * 0.1, 1e-12);
    close_case(&c);
  }
}

/* A solve that fails is taken again, a quarter as long; with the shortest step somebody else is to know what to do */
static void test_failed_solve(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    Case      c;
    PetscReal error;

    open_case(&c, ADAPT "-flow_time be", k ? "-sim_adapt_min 0.1" : "", 0.1);
    begin(&c, 2);
    assert_int_equal(try_step(&c, 2, 0.1, &error, KSP_DIVERGED_ITS), k);
    if (!k) NEAR(next_step(&c), 0.25 * 0.1, 1e-12);
    close_case(&c);
  }
}

/* At most so many times as long; not at all for a little */
static void test_growth(void **state)
{
  Case      c;
  PetscReal error;

  (void)state;
  open_case(&c, ADAPT "-flow_time be -sim_adapt_tolerance 1", "-sim_adapt_growth 1.4", 0.1);
  begin(&c, 2);
  (void)try_step(&c, 2, 0.1, &error, 1);
  take_step(&c, 2, 0.1, 0);
  NEAR(next_step(&c), 0.14, 1e-12);
  close_case(&c);
  open_case(&c, ADAPT "-flow_time be -sim_adapt_tolerance 0.015", "", 0.1); /* the error is dt^2 = .01: .9 times 1.22 */
  begin(&c, 2);
  assert_true(try_step(&c, 2, 0.1, &error, 1));
  NEAR(error, 0.01, 1e-12);
  take_step(&c, 2, 0.1, 0);
  NEAR(next_step(&c), 0.1, 1e-15);
  close_case(&c);
}

/* An error that a shorter step leaves as it is is a jump, which none resolves: it is taken as long as it was */
static void test_jump(void **state)
{
  Case       c;
  PetscReal *u;
  PetscBool  good;

  (void)state;
  open_case(&c, ADAPT "-flow_time be -sim_adapt_tolerance 0.02", "", 0.1);
  begin(&c, 2);
  for (PetscInt k = 0; k < 2; k++) {
    (void)solve_step(&c, 2, k ? 0.05 : 0.1);
    OK(CoupleGetSystem(c.couple, &u, NULL, NULL, NULL, NULL));
    for (PetscInt i = 0; i < c.l->nnode_all * 2; i += 2) u[i] += 3;
    OK(AdaptCheck(c.adapt, 1, &good));
    assert_int_equal(good, k);
  }
  take_step(&c, 2, 0.05, 0);
  NEAR(next_step(&c), 0.1, 1e-12);
  close_case(&c);
}

/* CFL numbers grow as steps do */
static void test_cfl(void **state)
{
  Case c;

  (void)state;
  open_case(&c, ADAPT, "-sim_adapt_cfl 5", 0.1);
  OK(FlowBeginStep(c.flow, 0.1, 0.1));
  OK(CoupleUpdateGeometry(c.couple));
  take_step(&c, 1, 0.1, 8);
  NEAR(next_step(&c), 0.1 * 5 / 8, 1e-12);
  assert_string_equal(holder(&c), "cfl");
  close_case(&c);
}

/* The last two steps before a time share what is left */
static void test_times_to_hit(void **state)
{
  const PetscReal left[] = {1, 0.15, 0.1000000001, 0.07}, want[] = {0.1, 0.075, 0.1000000001, 0.07};
  Case            c;
  PetscReal       dt;
  PetscBool       hits;

  (void)state;
  open_case(&c, ADAPT, "", 0.1);
  for (PetscInt i = 0; i < 4; i++) {
    OK(AdaptGetStep(c.adapt, 3, 3 + left[i], &dt, &hits));
    NEAR(dt, want[i], 1e-12);
    assert_int_equal(hits, i > 1);
    assert_string_equal(holder(&c), i ? "time" : "error");
  }
  close_case(&c);
}

#define DISC \
  "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_position 0.5,0.5 -particle_a_density 2 "

/* Half a cell of way; half of the gap, at the rate at which it closed, or where there was none before at twice the
   speed; gaps within the range of the contact count as that */
static void test_bodies_limit_the_step(void **state)
{
  Case      c;
  PetscReal range;

  (void)state;
  open_case(&c, ADAPT DISC, "-contact_range 0.01", 0.5);
  OK(ContactGetRange(c.contact, &range));
  NEAR(range, 0.01, 1e-15);
  for (PetscInt k = 0; k < c.s->n; k++) c.s->u[k][0] = 3;
  NEAR(next_step(&c), 0.5 * 0.25 / 3, 1e-12);
  assert_string_equal(holder(&c), "displacement");
  for (PetscInt n = 0; n < 4; n++) {
    const PetscReal gap[] = {0.3, 0.2, 0.004, 0.004}, speed[] = {0.75, 0, 0, 0},
                    limit[] = {0.5 * 0.3 / 1.5, 0.5 * 0.2 / 1, 0.5 * 0.01 / 1.96, 0.2};

    OK(FlowBeginStep(c.flow, 0.1 * (n + 1), 0.1));
    OK(CoupleUpdateGeometry(c.couple));
    for (PetscInt k = 0; k < c.s->n; k++) {
      c.s->gap[k]  = gap[n];
      c.s->u[k][0] = speed[n];
    }
    take_step(&c, 1, 0.1, 0);
    for (PetscInt k = 0; k < c.s->n; k++) c.s->u[k][0] = 0;
    NEAR(next_step(&c), limit[n], 1e-12); /* at last: twice the step before */
    assert_string_equal(holder(&c), n < 3 ? "gap" : "growth");
  }
  close_case(&c);
}

/* Somebody who takes part in the coupling, and is asked once a step */
static PetscReal wave    = 1;
static PetscInt  n_asked = 0;

static PetscErrorCode limit_wave(Couple couple, void *part, PetscReal *dt)
{
  PetscFunctionBeginUser;
  (void)couple;
  (void)part;
  n_asked++;
  *dt = PetscMin(*dt, wave);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A participant shortens the step, and the table has its name; one that does not leaves the step to others */
static void test_participants_limit_the_step(void **state)
{
  static const CoupleParticipant part = {.name = "capillary_wave", .limit = limit_wave};
  Case                           c;
  PetscInt                       steps;

  (void)state;
  open_case(&c, ADAPT, "-sim_adapt_cfl 5", 0.1);
  OK(LimitsAddParticipants(c.limits, c.couple));
  OK(CoupleAddParticipant(c.couple, &part, NULL));
  NEAR(next_step(&c), 0.1, 1e-15); /* the wave stands more */
  assert_string_equal(holder(&c), "error");
  wave = 0.03;
  NEAR(next_step(&c), 0.03, 1e-15);
  assert_string_equal(holder(&c), "capillary_wave");
  OK(LimitsAccept(c.limits, 0.03));
  OK(LimitsCount(c.limits, "capillary_wave", &steps, NULL, NULL));
  assert_int_equal(steps, 1);
  assert_int_equal(n_asked, 2);
  close_case(&c);
}

/* ---- what is believed ---- */

#define CAVITY "-flow_time be "

typedef struct {
  FlowDiagnostics d;
  CoupleBalance   b;
} Made;

/* Kinetic energy 1, nothing wrong */
static Made sound(void)
{
  return (Made){.d = {.kinetic_energy = 1}, .b = {.size = 1}};
}

static PetscBool doubts(Case *c, const Made *made)
{
  CouplePower power;

  c->t += 0.1;
  OK(CoupleGetPower(c->couple, &power));
  OK(StepCheckMeasure(c->check, &made->d, &made->b, &power, c->t, 0.1));
  return StepCheckDoubts(c->check);
}

static void begin_judged(Case *c, const char options[], const char more[])
{
  open_case(c, options, more, 0.1);
  OK(FlowBeginStep(c->flow, 0.1, 0.1));
  OK(CoupleUpdateGeometry(c->couple));
}

static void test_sound_steps(void **state)
{
  Case c;
  Made made = sound();
  char why[256];

  (void)state;
  begin_judged(&c, CAVITY, "");
  made.d.divergence = 0.09 * PetscSqrtReal(2) / c.l->h;
  made.b.error      = 0.045;
  for (PetscInt i = 0; i < 10; i++) {
    made.d.kinetic_energy *= i % 2 ? 1.18 : 0.8;
    made.d.divergence = 0.09 * PetscSqrtReal(2 * made.d.kinetic_energy) / c.l->h;
    assert_false(doubts(&c, &made));
    OK(StepCheckResult(c.check, (PetscBool)(i == 9), why, sizeof(why)));
    assert_string_equal(why, "");
  }
  close_case(&c);
}

/* Velocities a cell; the largest velocity so far counts */
static void test_sign_of_divergence(void **state)
{
  Case c;
  Made made = sound();

  (void)state;
  begin_judged(&c, CAVITY, "");
  assert_false(doubts(&c, &made));
  made.d.divergence = 0.11 * PetscSqrtReal(2) / c.l->h;
  assert_true(doubts(&c, &made));
  made.d.kinetic_energy = 0.5;
  assert_true(doubts(&c, &made));
  made.d.divergence = 0.09 * PetscSqrtReal(2) / c.l->h;
  assert_false(doubts(&c, &made));
  close_case(&c);
}

/* The share that is not balanced; of forces that are not all round-off, and not of those by volume */
static void test_sign_of_momentum(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 3; k++) {
    Case c;
    Made made = sound();

    begin_judged(&c, CAVITY, k == 2 ? "-couple_force volume" : "");
    made.b.error = 0.06;
    if (k == 1) made.b.size = 1e-9;
    assert_int_equal(doubts(&c, &made), k == 0);
    close_case(&c);
  }
}

/* Energy out of nothing, more than a fifth a step; not what a force brings in */
static void test_sign_of_growth(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    Case       c;
    Made       made = sound();
    PetscReal *u;

    begin_judged(&c, CAVITY, k ? "-flow_force 3,0" : "");
    OK(CoupleGetSystem(c.couple, &u, NULL, NULL, NULL, NULL));
    for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) u[i] = i % 2 ? 0 : 0.5; /* power 1.5 over the unit square */
    assert_false(doubts(&c, &made));
    made.d.kinetic_energy = 1.3;
    assert_int_equal(doubts(&c, &made), !k);
    close_case(&c);
  }
}

/* Of a fluid that comes to rest what grows is next to nothing beside the largest energy */
static void test_growth_at_rest(void **state)
{
  Case c;
  Made made = sound();

  (void)state;
  begin_judged(&c, CAVITY, "");
  assert_false(doubts(&c, &made));
  made.d.kinetic_energy = 1e-9;
  assert_false(doubts(&c, &made));
  made.d.kinetic_energy = 1e-5;
  assert_false(doubts(&c, &made));
  made.d.kinetic_energy = 1e-2;
  assert_true(doubts(&c, &made));
  close_case(&c);
}

/* A polymer that gives back what it stored is no source; one that stores what nobody gave is one */
static void test_growth_of_a_polymer(void **state)
{
  Case                  c;
  Made                  made = sound();
  const FlowElasticity *elastic;
  FlowElasticity       *polymer;

  (void)state;
  begin_judged(&c, CAVITY, "-flow_rheology oldroyd_b -flow_rheology_time 1 -flow_rheology_solvent 0.5");
  OK(FlowGetElasticity(c.flow, &elastic));
  polymer         = (FlowElasticity *)elastic; /* the flow's own: stands for what FlowDiagnose finds */
  polymer->energy = 1;
  assert_false(doubts(&c, &made));
  made.d.kinetic_energy = 1.6;
  polymer->energy       = 0.4;
  assert_false(doubts(&c, &made));
  polymer->energy = 1.4;
  assert_true(doubts(&c, &made));
  close_case(&c);
}

/* Five in a row stop a run, a sound one between makes them begin anew; the message says what, of how much, and which
   option */
static void test_verdict(void **state)
{
  Case c;
  Made made = sound(), wrong = sound();
  char why[512];

  (void)state;
  begin_judged(&c, CAVITY, "");
  wrong.b.error = 0.5;
  for (PetscInt i = 0; i < 10; i++) {
    (void)doubts(&c, i == 4 ? &made : &wrong);
    OK(StepCheckResult(c.check, PETSC_FALSE, why, sizeof(why)));
    if (i < 9) assert_string_equal(why, "");
  }
  for (const char **text =
         (const char *[]){"the balance of momentum is 0.5", "-sim_check_momentum (0.05)", "after 5 steps", NULL};
       *text; text++)
    if (!strstr(why, *text)) fail_msg("'%s' is not in '%s'", *text, why);
  close_case(&c);
  begin_judged(&c, CAVITY, ""); /* a whole run in doubt */
  (void)doubts(&c, &wrong);
  OK(StepCheckResult(c.check, PETSC_TRUE, why, sizeof(why)));
  assert_string_equal(why, "");
  (void)doubts(&c, &wrong);
  OK(StepCheckResult(c.check, PETSC_TRUE, why, sizeof(why)));
  assert_non_null(strstr(why, "after 2 steps"));
  close_case(&c);
  begin_judged(&c, CAVITY, "-sim_check_steps 0"); /* never */
  for (PetscInt i = 0; i < 10; i++) (void)doubts(&c, &wrong);
  OK(StepCheckResult(c.check, PETSC_TRUE, why, sizeof(why)));
  assert_string_equal(why, "");
  close_case(&c);
}

/* Two radii in a step: nothing in the way; a wall in the way */
static void test_way(void **state)
{
  Case c;

  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    begin_judged(&c, CAVITY DISC, "-contact_law none");
    for (PetscInt i = 0; i < c.s->n; i++) {
      c.s->x[i][0] = k ? 0.85 : 0.6; /* at the end of its way */
      c.s->u[i][0] = k ? 4 : 2;
    }
    if (!k) OK(StepCheckDisplacement(c.check, 0.1, 0.1, PETSC_FALSE));
    else {
      for (PetscInt i = 0; i < c.s->n; i++) c.s->x[i][0] = 0.95;
      begin_error();
      expect_error(StepCheckDisplacement(c.check, 0.1, 0.1, PETSC_FALSE), PETSC_ERR_NOT_CONVERGED,
                   "goes 4 of its radii", "-sim_max_displacement (1", NULL);
    }
    close_case(&c);
  }
}

/* ---- loads ---- */

/* In a fluid at rest no more of a contact's force counts than the body's weight in the fluid: its acceleration without
   contact is as if it fell, not as if the contact pushed it */
static void test_share_of_a_load(void **state)
{
  const PetscReal weight = (2 - 1) * PETSC_PI * 0.01 * 10;

  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    const PetscReal force = k ? 100 * weight : 0.5 * weight;
    Case            c;
    SimComponents   part;
    PetscReal       mass, inertia[6], a[1][3], alpha[1][3];

    begin_judged(&c, DISC "-flow_gravity 0,-10", "");
    part = (SimComponents){.comm    = PETSC_COMM_WORLD,
                           .mesh    = c.mesh,
                           .flow    = c.flow,
                           .bodies  = c.bodies,
                           .couple  = c.couple,
                           .contact = c.contact};
    assert_int_equal(c.s->n, 1);
    c.s->contact_force[0][1] = force;
    OK(ContactGetMass(c.contact, 0, &mass, inertia));
    OK(ContactPhaseEstimate(&part, 0.1, 0.1, a, alpha));
    NEAR(a[0][0], 0, 1e-12);
    NEAR(a[0][1] * mass, -PetscMin(force, weight), 1e-6);
    close_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_error_sets_the_step),
                                     cmocka_unit_test(test_rejected),
                                     cmocka_unit_test(test_failed_solve),
                                     cmocka_unit_test(test_growth),
                                     cmocka_unit_test(test_jump),
                                     cmocka_unit_test(test_cfl),
                                     cmocka_unit_test(test_times_to_hit),
                                     cmocka_unit_test(test_bodies_limit_the_step),
                                     cmocka_unit_test(test_participants_limit_the_step),
                                     cmocka_unit_test(test_sound_steps),
                                     cmocka_unit_test(test_sign_of_divergence),
                                     cmocka_unit_test(test_sign_of_momentum),
                                     cmocka_unit_test(test_sign_of_growth),
                                     cmocka_unit_test(test_growth_at_rest),
                                     cmocka_unit_test(test_growth_of_a_polymer),
                                     cmocka_unit_test(test_verdict),
                                     cmocka_unit_test(test_way),
                                     cmocka_unit_test(test_share_of_a_load)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("step", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
