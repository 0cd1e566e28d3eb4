/* Constraint: P, its transpose, its matrix form, known parts, walls against bodies, detection of changes; in 2D and 3D,
   bodies across ranks and across periodic boundaries. */
/* ranks: 1 2 3 */
#include "core.h"
#include "rigid/projection.h"

/* Bodies 0 and 1 are unknown as a whole, 2 in its translation only, 3 is known; 4 covers no node but has slots */
#define NBODIES 5
static const PetscReal CENTRES[NBODIES][3] = {{0.30, 0.30, 0.35},
                                              {0.75, 0.55, 0.60},
                                              {0.25, 0.80, 0.70},
                                              {1.10, 0.85, 0.20},
                                              {9, 9, 9}};
static const PetscReal RADII[NBODIES]      = {0.2, 0.25, 0.15, 0.2, 0.1};

typedef struct {
  Mesh             mesh;
  Constraint       c;
  const MeshLocal *l;
  PetscInt         dim, nr, nodal, total, own, count; /* own: own nodal values; count: own bodies */
  unsigned char   *fixed;
  PetscInt        *node_body, unknown[NBODIES];
  PetscReal       *value, X[NBODIES][3], *U; /* U [NBODIES][nr]: all rigid velocities, known or not */
} Case;

static PetscBool on(PetscReal x, PetscReal face)
{
  return (PetscBool)(PetscAbsReal(x - face) < 1e-10);
}

/* Vector from the centre of body k to x, the short way round where the mesh is periodic */
static void arm(const Case *s, PetscInt k, const PetscReal x[], PetscReal r[3])
{
  r[2] = 0;
  for (PetscInt d = 0; d < s->dim; d++) {
    r[d] = x[d] - s->X[k][d];
    if (s->l->period[d] > 0) r[d] = remainder(r[d], s->l->period[d]);
  }
}

/* Where the bodies are and what the walls prescribe: all components at the bottom, the normal one at the right (slip),
   nothing elsewhere */
static void describe(Case *s)
{
  for (PetscInt i = 0; i < s->l->nnode_all; i++) {
    const PetscReal *x = s->l->x + i * s->dim;

    s->fixed[i]     = on(x[1], 0) ? (1 << s->dim) - 1 : on(x[0], 1.2) && s->l->period[0] == 0 ? 1 : 0;
    s->node_body[i] = -1;
    for (PetscInt k = 0; k < NBODIES && s->node_body[i] < 0; k++) {
      PetscReal r[3];

      arm(s, k, x, r);
      if (r[0] * r[0] + r[1] * r[1] + r[2] * r[2] <= RADII[k] * RADII[k]) s->node_body[i] = k;
    }
    for (PetscInt a = 0; a < s->dim; a++) s->value[i * s->dim + a] = noise(100000 + s->l->node_global[i] * s->dim + a);
  }
}

static void set_bodies(Case *s, PetscBool *changed)
{
  OK(ConstraintSetBodies(s->c, s->node_body, s->X, s->unknown, s->U, changed));
  s->count = ConstraintGetView(s->c)->nown;
}

static void open_case(Case *s, PetscInt dim, const char options[])
{
  give(options);
  OK(PetscOptionsSetValue(NULL, "-mesh_dimension", dim == 2 ? "2" : "3"));
  OK(PetscOptionsSetValue(NULL, "-mesh_cells", dim == 2 ? "12,10" : "6,5,5"));
  OK(PetscOptionsSetValue(NULL, "-mesh_upper", dim == 2 ? "1.2,1" : "1.2,1,1"));
  OK(MeshCreate(PETSC_COMM_WORLD, &s->mesh));
  OK(MeshGetLocal(s->mesh, &s->l));
  OK(ConstraintCreate(s->mesh, NBODIES, &s->c));
  OK(ConstraintGetRigidSize(s->c, &s->nr));
  OK(ConstraintGetSizes(s->c, &s->nodal, &s->total));
  s->dim = dim;
  s->own = s->l->nnode * dim;
  OK(PetscCalloc4(s->l->nnode_all, &s->fixed, s->l->nnode_all, &s->node_body, s->l->nnode_all * dim, &s->value,
                  NBODIES * s->nr, &s->U));
  for (PetscInt k = 0; k < NBODIES; k++) {
    for (PetscInt d = 0; d < 3; d++) s->X[k][d] = d < dim ? CENTRES[k][d] : 0;
    s->unknown[k] = (1 << s->nr) - 1;
  }
  s->unknown[2] = (1 << dim) - 1;
  s->unknown[3] = 0;
  for (PetscInt i = 0; i < NBODIES * s->nr; i++) s->U[i] = noise(500 + i);
  describe(s);
  OK(ConstraintSetBoundary(s->c, s->fixed, s->value));
  set_bodies(s, NULL);
}

static void close_case(Case *s)
{
  OK(PetscFree4(s->fixed, s->node_body, s->value, s->U));
  OK(ConstraintDestroy(&s->c));
  OK(MeshDestroy(&s->mesh));
}

static void for_all(void (*check)(Case *))
{
  const char *const options[] = {"", "-mesh_periodic x"};

  for (PetscInt i = 0; i < 4; i++) {
    Case s;

    open_case(&s, 2 + i / 2, options[i % 2]);
    check(&s);
    close_case(&s);
  }
}

/* No known parts: u = P u_r */
static void forget_known(Case *s)
{
  OK(PetscArrayzero(s->value, s->l->nnode_all * s->dim));
  for (PetscInt i = 0; i < NBODIES * s->nr; i++) s->U[i] = 0;
  set_bodies(s, NULL);
}

/* A reduced vector with noise everywhere, inert slots too */
static Vec noisy_reduced(const Case *s)
{
  Vec        ur;
  PetscReal *x;

  OK(ConstraintCreateVec(s->c, &ur));
  OK(VecGetArrayWrite(ur, &x));
  for (PetscInt i = 0; i < s->nodal; i++) x[i] = noise(7 + s->l->node_start * s->dim + i);
  for (PetscInt i = s->nodal; i < s->total; i++) x[i] = 0;
  for (PetscInt i = 0; i < s->count * s->nr; i++)
    x[s->nodal + i] = noise(900000 + ConstraintGetView(s->c)->own[i / s->nr] * s->nr + i % s->nr);
  OK(VecRestoreArrayWrite(ur, &x));
  return ur;
}

static void check_sizes(Case *s)
{
  PetscInt bodies;

  assert_int_equal(s->nr, s->dim == 2 ? 3 : 6);
  assert_int_equal(s->nodal, s->own);
  assert_int_equal(s->total, s->own + ConstraintGetView(s->c)->count * s->nr);
  bodies = (PetscInt)total(s->count);
  assert_int_equal(bodies, NBODIES);
}

/* A body's slots are where most of its nodes are */
static void check_places(Case *s)
{
  for (PetscInt k = 0; k < NBODIES; k++) {
    PetscInt  nodes = 0, most;
    PetscBool own   = PETSC_FALSE;

    for (PetscInt i = 0; i < s->l->nnode; i++) nodes += ConstraintGetView(s->c)->node_body[i] == k;
    for (PetscInt i = 0; i < s->count; i++) own = (PetscBool)(own || ConstraintGetView(s->c)->own[i] == k);
    most = (PetscInt)largest(nodes);
    if (own && s->unknown[k]) assert_int_equal(nodes, most);
  }
}

static void test_slots_lie_by_place(void **state)
{
  (void)state;
  for_all(check_places);
}

static void test_sizes(void **state)
{
  (void)state;
  for_all(check_sizes);
}

/* Every own and ghost node has the velocity that its kind asks for, component by component */
static void check_expand(Case *s)
{
  const PetscInt *body;
  PetscReal      *u, all[NBODIES * 6], covered[3] = {0, 0, 0};
  Vec             ur = noisy_reduced(s);

  OK(PetscMalloc1(s->l->nnode_all * s->dim, &u));
  OK(ConstraintExpand(s->c, ur, u));
  OK(ConstraintGetNodeBody(s->c, &body));
  for (PetscInt i = 0; i < NBODIES * s->nr; i++)
    all[i] = (s->unknown[i / s->nr] >> (i % s->nr)) & 1 ? noise(900000 + i) : s->U[i];
  for (PetscInt i = 0; i < s->l->nnode_all; i++) {
    const PetscInt k = s->fixed[i] ? -1 : s->node_body[i];
    PetscReal      r[3], w[3] = {0, 0, 0}, v[3];

    assert_int_equal(body[i], k);
    if (k >= 0) {
      arm(s, k, s->l->x + i * s->dim, r);
      for (PetscInt d = 0; d < 3; d++) w[d] = s->dim == 3 ? all[k * 6 + 3 + d] : d == 2 ? all[k * 3 + 2] : 0;
      for (PetscInt d = 0; d < 3; d++) v[d] = w[(d + 1) % 3] * r[(d + 2) % 3] - w[(d + 2) % 3] * r[(d + 1) % 3];
    }
    for (PetscInt a = 0; a < s->dim; a++) {
      const PetscBool wall = (PetscBool)((s->fixed[i] >> a) & 1);

      NEAR(u[i * s->dim + a],
           wall     ? s->value[i * s->dim + a]
           : k >= 0 ? all[k * s->nr + a] + v[a]
                    : noise(7 + s->l->node_global[i] * s->dim + a),
           1e-14);
      if (!wall && k < 0) BELOW(ConstraintGetPrescribed(s->c, i, a), 0);
      covered[wall ? 0 : k >= 0 ? 1 : 2] += i < s->l->nnode;
    }
  }
  for (PetscInt i = 0; i < 3; i++) assert_true(total(covered[i]) > 20); /* all three kinds occur */
  OK(PetscFree(u));
  OK(VecDestroy(&ur));
}

static void test_expand(void **state)
{
  (void)state;
  for_all(check_expand);
}

/* (P x, y) = (x, P^T y), with bodies that span several ranks */
static void check_adjoint(Case *s)
{
  PetscReal       *u, *y, *keep, *rigid, left, right;
  const PetscReal *x;
  Vec              ur;

  forget_known(s);
  ur = noisy_reduced(s);
  OK(PetscCalloc4(s->l->nnode_all * s->dim, &u, s->l->nnode_all * s->dim, &y, s->l->nnode_all * s->dim, &keep,
                  s->count * s->nr, &rigid));
  OK(ConstraintExpand(s->c, ur, u));
  fill_noise(s->l, 3, y);
  OK(PetscArraycpy(keep, y, s->own));
  OK(ConstraintReduceInPlace(s->c, y, rigid));
  OK(VecGetArrayRead(ur, &x));
  left  = dot(s->own, u, keep);
  right = dot(s->own, x, y) + dot(s->count * s->nr, x + s->own, rigid);
  NEAR(left, right, 1e-12 * (1 + PetscAbsReal(left)));
  if (s->count) {
    PetscReal top = 0;

    for (PetscInt i = 0; i < s->nr; i++) top = PetscMax(top, PetscAbsReal(rigid[i]));
    if (ConstraintGetView(s->c)->own[0] == 0) assert_true(top > 0.1); /* body 0 has received something */
  }
  OK(VecRestoreArrayRead(ur, &x));
  OK(PetscFree4(u, y, keep, rigid));
  OK(VecDestroy(&ur));
}

static void test_transpose(void **state)
{
  (void)state;
  for_all(check_adjoint);
}

/* Reduce adds to what the rigid slots hold, and clears the inert slots */
static void check_reduce(Case *s)
{
  const PetscInt *slot;
  PetscInt        n;
  PetscReal      *y, *again, *once, *twice;

  OK(PetscCalloc4(s->l->nnode_all * s->dim, &y, s->l->nnode_all * s->dim, &again, s->count * s->nr, &once,
                  s->count * s->nr, &twice));
  fill_noise(s->l, 4, y);
  fill_noise(s->l, 4, again);
  for (PetscInt i = 0; i < s->count * s->nr; i++) twice[i] = 5;
  OK(ConstraintReduceInPlace(s->c, y, once));
  OK(ConstraintReduceInPlace(s->c, again, twice));
  for (PetscInt i = 0; i < s->count * s->nr; i++) NEAR(twice[i], 5 + once[i], 1e-13);
  n    = ConstraintGetView(s->c)->inert.n;
  slot = ConstraintGetView(s->c)->inert.slot;
  for (PetscInt j = 0; j < n; j++) BELOW(y[slot[j]], 0);
  fill_noise(s->l, 4, again);
  for (PetscInt j = 0; j < n; j++) again[slot[j]] = 0;
  BELOW(max_difference(s->own, y, again), 0);
  OK(PetscFree4(y, again, once, twice));
}

static void test_reduce(void **state)
{
  (void)state;
  for_all(check_reduce);
}

static void check_expand_in_place(Case *s)
{
  const PetscInt  *slot, *body;
  const PetscReal *coef, *x;
  PetscInt         n, *inert;
  PetscReal       *v, *keep, all[NBODIES * 6];
  Vec              ur = noisy_reduced(s);

  for (PetscInt i = 0; i < NBODIES * s->nr; i++) all[i] = noise(900000 + i);
  n    = ConstraintGetView(s->c)->inert.n;
  slot = ConstraintGetView(s->c)->inert.slot;
  body = ConstraintGetView(s->c)->inert.body;
  coef = ConstraintGetView(s->c)->inert.coef;
  OK(PetscMalloc3(s->l->nnode_all * s->dim, &v, s->l->nnode_all * s->dim, &keep, s->own, &inert));
  fill_noise(s->l, 5, v);
  fill_noise(s->l, 5, keep);
  OK(VecGetArrayRead(ur, &x));
  OK(ConstraintExpandInPlace(s->c, x + s->nodal, v));
  OK(VecRestoreArrayRead(ur, &x));
  for (PetscInt i = 0; i < s->own; i++) inert[i] = 0;
  for (PetscInt j = 0; j < n; j++) { /* rows: ascending, unknown degrees of freedom only */
    PetscReal value = 0, R[18];

    assert_true(j == 0 || slot[j] > slot[j - 1]);
    inert[slot[j]] = 1;
    if (body[j] >= 0) OK(ConstraintRigidMap(s->c, slot[j] / s->dim, body[j], R));
    for (PetscInt q = 0; q < s->nr && body[j] >= 0; q++) {
      NEAR(coef[j * s->nr + q], (s->unknown[body[j]] >> q) & 1 ? R[slot[j] % s->dim * s->nr + q] : 0, 0);
      value += coef[j * s->nr + q] * all[body[j] * s->nr + q];
    }
    NEAR(v[slot[j]], value, 1e-14);
  }
  for (PetscInt i = 0; i < s->own; i++) {
    const PetscInt node = i / s->dim;

    assert_int_equal(inert[i], s->fixed[node] ? (s->fixed[node] >> (i % s->dim)) & 1 : s->node_body[node] >= 0);
    if (!inert[i]) NEAR(v[i], keep[i], 0);
  }
  OK(PetscFree3(v, keep, inert));
  OK(VecDestroy(&ur));
}

static void test_expand_in_place(void **state)
{
  (void)state;
  for_all(check_expand_in_place);
}

/* The assembled matrix does what the matrix-free forms do */
static void check_matrix(Case *s)
{
  Mat              P;
  Vec              ur, u, back;
  PetscReal       *want, *y, *rigid, *a;
  const PetscReal *b;

  forget_known(s);
  ur = noisy_reduced(s);
  OK(ConstraintCreateMat(s->c, &P));
  OK(MatCreateVecs(P, &back, &u));
  OK(PetscCalloc3(s->l->nnode_all * s->dim, &want, s->l->nnode_all * s->dim, &y, s->count * s->nr, &rigid));
  OK(ConstraintExpand(s->c, ur, want));
  OK(MatMult(P, ur, u));
  OK(VecGetArrayRead(u, &b));
  BELOW(max_difference(s->own, b, want), 1e-14);
  OK(VecRestoreArrayRead(u, &b));
  fill_noise(s->l, 6, y);
  OK(VecGetArrayWrite(u, &a));
  OK(PetscArraycpy(a, y, s->own));
  OK(VecRestoreArrayWrite(u, &a));
  OK(MatMultTranspose(P, u, back));
  OK(ConstraintReduceInPlace(s->c, y, rigid));
  OK(VecGetArrayRead(back, &b));
  BELOW(max_difference(s->own, b, y), 1e-14);
  BELOW(max_difference(s->count * s->nr, b + s->own, rigid), 1e-12);
  OK(VecRestoreArrayRead(back, &b));
  OK(PetscFree3(want, y, rigid));
  OK(VecDestroy(&ur));
  OK(VecDestroy(&u));
  OK(VecDestroy(&back));
  OK(MatDestroy(&P));
}

static void test_matrix(void **state)
{
  (void)state;
  for_all(check_matrix);
}

/* Restrict undoes Expand, and every rank learns all rigid velocities */
static void check_restrict(Case *s)
{
  PetscReal       *u, *again, all[NBODIES * 6];
  const PetscInt  *slot;
  const PetscReal *x;
  PetscInt         n;
  Vec              ur = noisy_reduced(s), back;

  OK(VecDuplicate(ur, &back));
  OK(PetscMalloc2(s->l->nnode_all * s->dim, &u, s->l->nnode_all * s->dim, &again));
  OK(ConstraintExpand(s->c, ur, u));
  for (PetscInt i = 0; i < NBODIES * s->nr; i++) all[i] = s->U[i];
  OK(VecGetArrayRead(ur, &x));
  OK(ConstraintGatherRigid(s->c, x + s->l->nnode * s->dim, all));
  OK(VecRestoreArrayRead(ur, &x));
  for (PetscInt i = 0; i < NBODIES * s->nr; i++)
    NEAR(all[i], (s->unknown[i / s->nr] >> (i % s->nr)) & 1 ? noise(900000 + i) : s->U[i], 0);
  OK(ConstraintRestrict(s->c, u, all, back));
  n    = ConstraintGetView(s->c)->inert.n;
  slot = ConstraintGetView(s->c)->inert.slot;
  OK(VecGetArrayRead(back, &x));
  for (PetscInt j = 0; j < n; j++) BELOW(x[slot[j]], 0);
  for (PetscInt i = 0; i < s->count * s->nr; i++)
    NEAR(x[s->nodal + i],
         (s->unknown[ConstraintGetView(s->c)->own[i / s->nr]] >> (i % s->nr)) & 1
           ? all[ConstraintGetView(s->c)->own[i / s->nr] * s->nr + i % s->nr]
           : 0,
         0);
  OK(VecRestoreArrayRead(back, &x));
  OK(ConstraintExpand(s->c, back, again));
  BELOW(max_difference(s->l->nnode_all * s->dim, u, again), 0);
  OK(PetscFree2(u, again));
  OK(VecDestroy(&ur));
  OK(VecDestroy(&back));
}

static void test_restrict(void **state)
{
  (void)state;
  for_all(check_restrict);
}

/* A body that reaches the bottom and the slip wall: wall nodes keep the wall's values */
static void test_walls_win(void **state)
{
  (void)state;
  Case            s;
  const PetscInt *body;
  PetscReal       both = 0;

  open_case(&s, 2, "");
  s.X[0][0] = 1.15;
  s.X[0][1] = 0.1;
  describe(&s);
  set_bodies(&s, NULL);
  OK(ConstraintGetNodeBody(s.c, &body));
  for (PetscInt i = 0; i < s.l->nnode_all; i++) {
    both += i < s.l->nnode && s.node_body[i] == 0 && s.fixed[i];
    assert_int_equal(body[i], s.fixed[i] ? -1 : s.node_body[i]);
  }
  assert_true(total(both) > 5);
  check_expand(&s);
  check_expand(&s);
  close_case(&s);
}

/* More walls after the bodies are known: everything follows */
static void test_boundary_changes_later(void **state)
{
  (void)state;
  Case s;

  open_case(&s, 2, "");
  for (PetscInt i = 0; i < s.l->nnode_all; i++)
    if (s.l->x[2 * i] < 0.25) s.fixed[i] = 3; /* some of them in bodies */
  OK(ConstraintSetBoundary(s.c, s.fixed, s.value));
  set_bodies(&s, NULL);
  check_expand(&s);
  check_expand(&s);
  check_matrix(&s);
  close_case(&s);
}

static void test_changes(void **state)
{
  (void)state;
  Case        s;
  PetscBool   changed;
  PetscMPIInt rank;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  open_case(&s, 2, "");
  set_bodies(&s, &changed);
  assert_false(changed);
  /* velocities are no change of the set, but reach the known part */
  for (PetscInt i = 0; i < NBODIES * s.nr; i++) s.U[i] += 1;
  set_bodies(&s, &changed);
  assert_false(changed);
  check_expand(&s);
  s.X[1][0] += 1e-6; /* no node changes sides */
  set_bodies(&s, &changed);
  assert_true(changed);
  check_expand(&s);
  s.unknown[0] = 1;
  set_bodies(&s, &changed);
  assert_true(changed);
  check_expand(&s);
  set_bodies(&s, &changed);
  assert_false(changed);
  if (rank == 0) { /* one node leaves its body, known to one rank only */
    PetscInt i = 0;

    while (s.fixed[i] || s.node_body[i] < 0) i++;
    s.node_body[i] = -1;
  }
  set_bodies(&s, &changed);
  assert_true(changed);
  set_bodies(&s, &changed);
  assert_false(changed);
  close_case(&s);
}

/* Without bodies P is the identity on free components */
static void test_no_bodies(void **state)
{
  (void)state;
  Mesh       mesh;
  Constraint c;
  Vec        ur;
  PetscInt   nodal, all, n;
  Mat        P;

  give("-mesh_cells 4,4");
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(ConstraintCreate(mesh, 0, &c));
  OK(ConstraintGetSizes(c, &nodal, &all));
  assert_int_equal(nodal, all);
  assert_int_equal(ConstraintGetView(c)->inert.n, 0);
  OK(ConstraintCreateVec(c, &ur));
  OK(VecGetSize(ur, &n));
  assert_int_equal(n, 2 * 81);
  OK(ConstraintCreateMat(c, &P));
  OK(MatDestroy(&P));
  OK(VecDestroy(&ur));
  OK(ConstraintDestroy(&c));
  OK(MeshDestroy(&mesh));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_sizes),     cmocka_unit_test(test_slots_lie_by_place),
                                     cmocka_unit_test(test_expand),    cmocka_unit_test(test_transpose),
                                     cmocka_unit_test(test_reduce),    cmocka_unit_test(test_expand_in_place),
                                     cmocka_unit_test(test_matrix),    cmocka_unit_test(test_restrict),
                                     cmocka_unit_test(test_walls_win), cmocka_unit_test(test_boundary_changes_later),
                                     cmocka_unit_test(test_changes),   cmocka_unit_test(test_no_bodies)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("constraint", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
