/* Refined meshes: counts against p4est's, the same trees on any number of ranks, places of hanging points, patch
   test. */
/* ranks: 1 2 3 7 */
#include "core.h"
#include "flow/flow.h"
#include "mesh/carry.h"
#include "mesh/state.h"

/* ---- surfaces ---- */

#define MAX_BALLS 40

typedef struct {
  PetscInt  dim, n;
  PetscReal period[3];
  PetscReal x[MAX_BALLS][3], radius[MAX_BALLS];
} Balls;

static PetscErrorCode ball_distance(void *context, const PetscReal x[3], PetscReal reach, PetscReal *d)
{
  const Balls *b = context;

  (void)reach;
  *d = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < b->n; i++) {
    PetscReal r = 0;

    for (PetscInt a = 0; a < b->dim; a++) r += PetscSqr(DomainNearest(b->period[a], x[a] - b->x[i][a], 0));
    *d = PetscMin(*d, PetscAbsReal(PetscSqrtReal(r) - b->radius[i]));
  }
  return PETSC_SUCCESS;
}

/* Points of random places: with a narrow band a tree as ragged as a balanced one can be */
static Balls random_points(PetscInt dim, PetscInt n, PetscInt seed)
{
  Balls b = {.dim = dim, .n = n};

  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0; a < dim; a++) b.x[i][a] = 0.5 + 0.5 * noise(100 * seed + 3 * i + a);
  return b;
}

static Balls one_ball(PetscInt dim)
{
  return (Balls){.dim = dim, .n = 1, .x = {{0.5, 0.5, 0.5}}, .radius = {0.25}};
}

static void create(const char options[], Balls *b, Mesh *m)
{
  MeshSurface s = {.distance = ball_distance, .context = b};

  give(options);
  OK(MeshCreateAround(PETSC_COMM_WORLD, &s, m));
}

/* ---- counts ---- */

static void check_counts(const char options[], PetscInt dim, PetscInt cells, PetscInt nodes)
{
  Balls            b = one_ball(dim);
  Mesh             m;
  const MeshLocal *l;

  create(options, &b, &m);
  OK(MeshGetLocal(m, &l));
  assert_int_equal(l->ncell_global, cells);
  assert_int_equal(l->nnode_global, nodes);
  OK(MeshDestroy(&m));
}

/* Numbers of p4est_lnodes_new (degree 2) for forests of the same rule, balanced across corners */
static void test_counts(void **state)
{
  (void)state;
  check_counts("-mesh_cells 16,16 -mesh_levels 4 -mesh_refine_distance 1.2", 2, 3268, 12193);
  check_counts("-mesh_dimension 3 -mesh_cells 6,6,6 -mesh_levels 3 -mesh_refine_distance 1.2", 3, 11752, 83541);
}

/* ---- places ---- */

static const char *const TREES[] =
  {"-mesh_cells 5,4 -mesh_levels 3 -mesh_refine_distance 0.8",
   "-mesh_cells 4,3 -mesh_levels 4 -mesh_refine_distance 0.9 -mesh_periodic x,y",
   "-mesh_focus 0.4,0.4,0.6,0.6 -mesh_focus_h 0.1 -mesh_levels 2 -mesh_refine_distance 0.8",
   "-mesh_dimension 3 -mesh_cells 3,4,3 -mesh_levels 2 -mesh_refine_distance 0.8",
   "-mesh_dimension 3 -mesh_cells 3,3,3 -mesh_levels 2 -mesh_refine_distance 0.8 -mesh_periodic y"};
#define NTREES (PetscInt)(sizeof(TREES) / sizeof(TREES[0]))

static void create_random(PetscInt tree, Mesh *m, const MeshLocal **l)
{
  Balls b = random_points(tree < 3 ? 2 : 3, tree < 3 ? 7 : 4, 17 + tree);

  for (PetscInt a = 0; a < 2; a++) b.period[a] = tree == 1 || (tree == 4 && a == 1);

  create(TREES[tree], &b, m);
  OK(MeshGetLocal(*m, l));
}

/* Places of every cell, also of one with nodes of a large face in its slots, are those of a rectangle, and the cells
   fill the box; nodes of ghosts are where their owner has them */
static void test_places(void **state)
{
  (void)state;
  for (PetscInt t = 0; t < NTREES; t++) {
    Mesh             m;
    const MeshLocal *l;
    PetscReal        volume  = 0, *x;
    PetscInt         hanging = 0;

    create_random(t, &m, &l);
    for (PetscInt c = 0; c < l->ncell_all; c++) {
      PetscReal xc[MESH_MAX_NB * 3], v = 1;

      OK(MeshCellCoordinates(m, c, xc));
      hanging += c < l->ncell && MeshCellHang(l, c);
      for (PetscInt d = 0; d < l->dim; d++) v *= xc[(l->nb - 1) * l->dim + d] - xc[d];
      if (c < l->ncell) volume += v;
      for (PetscInt j = 0; j < l->nb; j++) {
        const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9};

        for (PetscInt d = 0; d < l->dim; d++)
          NEAR(xc[j * l->dim + d], xc[d] + 0.5 * at[d] * (xc[(l->nb - 1) * l->dim + d] - xc[d]), 1e-14);
      }
    }
    NEAR(total(volume), 1, 1e-12);
    assert_true(total((PetscReal)hanging) > 0);
    OK(PetscMalloc1(l->nnode_all * l->dim, &x));
    OK(PetscArraycpy(x, l->x, l->nnode_all * l->dim));
    OK(MeshSyncNodes(m, l->dim, x));
    NEAR(max_difference(l->nnode_all * l->dim, x, l->x), 0, 0);
    OK(PetscFree(x));
    OK(MeshDestroy(&m));
  }
}

/* A rank that owns a node knows all cells that have it: each adds one */
static void test_ghosts(void **state)
{
  (void)state;
  for (PetscInt t = 0; t < NTREES; t++) {
    Mesh             m;
    const MeshLocal *l;
    PetscReal       *v;

    create_random(t, &m, &l);
    OK(PetscCalloc1(l->nnode_all, &v));
    for (PetscInt i = 0; i < l->ncell * l->nb; i++) v[l->cell_node[i]] += 1;
    OK(MeshSumNodes(m, 1, v));
    for (PetscInt i = 0; i < l->nnode; i++) NEAR(v[i], l->node_cell_ptr[i + 1] - l->node_cell_ptr[i], 0);
    OK(PetscFree(v));
    OK(MeshDestroy(&m));
  }
}

/* ---- flow ---- */

/* Quadratic, free of divergence, and the pressure that makes it a Stokes flow of viscosity 1: p = 2 x - 4 y + 2 z,
   laplacian of u = its gradient */
static void parabolic(const PetscReal x[], PetscReal v[], PetscInt dim)
{
  if (dim == 2) {
    v[0] = x[0] * x[0] - 2 * x[0] * x[1];
    v[1] = -2 * x[0] * x[1] + x[1] * x[1] - 3 * x[0] * x[0];
  } else {
    v[0] = x[1] * x[1] + x[0] * x[2] - x[0] * x[1];
    v[1] = x[0] * x[2] - x[1] * x[2] + 0.5 * x[1] * x[1] - x[2] * x[2];
    v[2] = x[0] * x[1] + 3 * x[0] * x[0];
  }
}

/* Laplacians of parabolic() */
static const PetscReal SLOPE[2][3] = {{2, -4, 0}, {2, -1, 6}};

/* Momentum residual at all nodes that no boundary has, and divergence in all cells, of the exact solution */
static void test_patch(void **state)
{
  (void)state;
  for (PetscInt t = 0; t < NTREES; t++) {
    Mesh             m;
    Flow             f;
    const MeshLocal *l;
    PetscReal       *u, *p, *r, *y, top = 0;
    const PetscReal *mass;
    PetscBool       *bound;
    PetscInt         nb;

    if (t == 1 || t == 4) continue; /* a polynomial is not periodic */
    create_random(t, &m, &l);
    OK(PetscOptionsInsertString(NULL, "-flow_viscosity 1 -flow_convection false -flow_density 1e-14"));
    OK(FlowCreate(m, &f));
    OK(FlowBeginStep(f, 0, 1));
    OK(PetscMalloc5(l->nnode_all * l->dim, &u, l->ncell_all * (l->dim + 1), &p, l->nnode_all * l->dim, &r,
                    l->ncell * (l->dim + 1), &y, l->nnode_all, &bound));
    OK(PetscArrayzero(r, l->nnode_all * l->dim));
    OK(PetscArrayzero(bound, l->nnode_all));
    for (PetscInt i = 0; i < l->nnode_all; i++) parabolic(l->x + i * l->dim, u + i * l->dim, l->dim);
    OK(FlowDivergence(f, u, y));
    BELOW(max_abs(l->ncell * (l->dim + 1), y), 1e-14);
    {
      const PetscReal *size;

      OK(FlowGetCellSize(f, &size));
      for (PetscInt c = 0; c < l->ncell; c++) {
        const PetscReal *x = l->x + l->cell_node[c * l->nb + l->nb / 2] * l->dim;

        p[c * (l->dim + 1)] = 0;
        for (PetscInt a = 0; a < l->dim; a++) {
          p[c * (l->dim + 1)] += SLOPE[l->dim - 2][a] * x[a];
          p[c * (l->dim + 1) + 1 + a] = SLOPE[l->dim - 2][a] * size[c];
        }
      }
    }
    for (PetscInt c = 0; c < l->ncell; c++) {
      PetscReal rc[MESH_MAX_NB * 3];

      OK(FlowCellResidual(f, c, u, p, rc));
      for (PetscInt j = 0; j < l->nb * l->dim; j++)
        r[l->cell_node[c * l->nb + j / l->dim] * l->dim + j % l->dim] += rc[j];
    }
    OK(MeshSumNodes(m, l->dim, r));
    OK(MeshGetBoundaryCount(m, &nb));
    for (PetscInt b = 0; b < nb; b++) {
      PetscInt        n;
      const PetscInt *node;

      OK(MeshGetBoundaryNodes(m, b, &n, &node));
      for (PetscInt i = 0; i < n; i++) bound[node[i]] = PETSC_TRUE;
    }
    for (PetscInt i = 0; i < l->nnode * l->dim; i++)
      if (!bound[i / l->dim]) top = PetscMax(top, PetscAbsReal(r[i]));
    BELOW(largest(top), 1e-11);
    OK(FlowGetLumpedMass(f, &mass));
    for (PetscInt i = 0; i < l->nnode; i++) assert_true(mass[i] > 0);
    OK(PetscFree5(u, p, r, y, bound));
    OK(FlowDestroy(&f));
    OK(MeshDestroy(&m));
  }
}

/* Made anew around other points, a mesh gets quadratic velocities and linear cell functions as they were */
static void test_carry(void **state)
{
  (void)state;
  for (PetscInt t = 0; t < NTREES; t++) {
    Mesh             m, old;
    const MeshLocal *l, *lo;
    Balls            b = random_points(t < 3 ? 2 : 3, t < 3 ? 7 : 4, 91 + t);
    PetscReal       *u, *p, *v, *q;

    if (t == 1 || t == 4) continue; /* a polynomial is not periodic */
    create_random(t, &m, &l);
    /* other base cells and levels in the same box */
    if (t == 0) give("-mesh_cells 7,5 -mesh_levels 2 -mesh_refine_distance 0.8");
    if (t == 3) give("-mesh_dimension 3 -mesh_cells 4,3,5 -mesh_levels 1 -mesh_refine_distance 0.8");
    OK(MeshRemesh(m, &(MeshSurface){.distance = ball_distance, .context = &b}, &old));
    OK(MeshGetLocal(old, &lo));
    assert_int_equal(l->meshes, 1);
    assert_true(l->ncell_global != lo->ncell_global);
    OK(PetscMalloc4(lo->nnode_all * l->dim, &u, lo->ncell * (l->dim + 1), &p, l->nnode_all * l->dim, &v,
                    l->ncell * (l->dim + 1), &q));
    for (PetscInt i = 0; i < lo->nnode_all; i++) parabolic(lo->x + i * l->dim, u + i * l->dim, l->dim);
    for (PetscInt pass = 0; pass < 2; pass++) {
      if (pass) OK(MeshCarryVelocities(old, m, 1, (const PetscReal *const *)&u, &v));
      else OK(MeshCarryNodes(old, m, l->dim, u, v));
      for (PetscInt i = 0; i < l->nnode_all; i++) {
        PetscReal want[3];

        parabolic(l->x + i * l->dim, want, l->dim);
        for (PetscInt a = 0; a < l->dim; a++) NEAR(v[i * l->dim + a], want[a], 1e-13);
      }
    }
    for (PetscInt pass = 0; pass < 2; pass++) {
      for (PetscInt c = 0; c < (pass ? l : lo)->ncell; c++) {
        PetscReal xc[MESH_MAX_NB * 3], want[4] = {0};

        OK(MeshCellCoordinates(pass ? m : old, c, xc));
        for (PetscInt a = 0; a < l->dim; a++) {
          want[0] += SLOPE[l->dim - 2][a] * 0.5 * (xc[(l->nb - 1) * l->dim + a] + xc[a]);
          want[1 + a] = SLOPE[l->dim - 2][a] * 0.5 * (xc[(l->nb - 1) * l->dim + a] - xc[a]);
        }
        for (PetscInt k = 0; k <= l->dim; k++) {
          if (pass) NEAR(q[c * (l->dim + 1) + k], want[k], 1e-13);
          else p[c * (l->dim + 1) + k] = want[k];
        }
      }
      if (!pass) OK(MeshCarryCells(old, m, p, q));
    }
    OK(PetscFree4(u, p, v, q));
    OK(MeshDestroy(&old));
    OK(MeshDestroy(&m));
  }
}

/* Of a field [nnode_all][dim], by Simpson's rule in every cell */
static void integrate(Mesh m, const PetscReal v[], PetscReal sum[3])
{
  const MeshLocal *l;

  OK(MeshGetLocal(m, &l));
  for (PetscInt a = 0; a < 3; a++) sum[a] = 0;
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal xc[MESH_MAX_NB * 3], vc[MESH_MAX_NB * 3], volume = 1;

    OK(MeshCellCoordinates(m, c, xc));
    for (PetscInt j = 0; j < l->nb * l->dim; j++) vc[j] = v[l->cell_node[c * l->nb + j / l->dim] * l->dim + j % l->dim];
    MeshCellGather(l, c, l->dim, vc);
    for (PetscInt a = 0; a < l->dim; a++) volume *= (xc[(l->nb - 1) * l->dim + a] - xc[a]) / 6;
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscReal weight = volume * (j % 3 == 1 ? 4 : 1) * (j / 3 % 3 == 1 ? 4 : 1) *
                               (l->dim == 3 && j / 9 == 1 ? 4 : 1);

      for (PetscInt a = 0; a < l->dim; a++) sum[a] += weight * vc[j * l->dim + a];
    }
  }
  for (PetscInt a = 0; a < 3; a++) sum[a] = total(sum[a]);
}

/* Where a ball has moved on, cells are joined and halved: any velocity keeps its integral, which its values alone do
   not */
static void test_carry_conserves(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Mesh             m, old;
    const MeshLocal *l, *lo;
    Balls            b = one_ball(dim);
    PetscReal       *u, *v, before[3], after[3], plain[3], lost = 0;

    for (PetscInt a = 0; a < dim; a++) b.period[a] = 1;
    create(dim == 2 ? "-mesh_cells 4,4 -mesh_levels 3 -mesh_periodic x,y"
                    : "-mesh_dimension 3 -mesh_cells 3,3,3 -mesh_levels 2 -mesh_refine_distance 1 -mesh_periodic x,y,z",
           &b, &m);
    b.x[0][0] += dim == 2 ? 0.07 : 0.15;
    OK(MeshRemesh(m, &(MeshSurface){.distance = ball_distance, .context = &b}, &old));
    OK(MeshGetLocal(old, &lo));
    OK(MeshGetLocal(m, &l));
    OK(PetscMalloc2(lo->nnode_all * dim, &u, l->nnode_all * dim, &v));
    for (PetscInt i = 0; i < lo->nnode_all * dim; i++) u[i] = noise((int)lo->node_global[i / dim] * 3 + i % dim);
    integrate(old, u, before);
    OK(MeshCarryNodes(old, m, dim, u, v));
    integrate(m, v, plain);
    OK(MeshCarryVelocities(old, m, 1, (const PetscReal *const *)&u, &v));
    integrate(m, v, after);
    for (PetscInt a = 0; a < dim; a++) {
      NEAR(after[a], before[a], 1e-14);
      lost = PetscMax(lost, PetscAbsReal(plain[a] - before[a]));
    }
    assert_true(lost > 1e-5);
    OK(PetscFree2(u, v));
    OK(MeshDestroy(&old));
    OK(MeshDestroy(&m));
  }
}

/* Whose a place is: of the centre of every cell, and of what lies beside its corners, on a graded box too */
static void check_curve(const char options[], PetscInt dim)
{
  Balls            b = one_ball(dim);
  Mesh             m;
  Curve            curve;
  const MeshLocal *l;
  PetscMPIInt      rank;

  create(options, &b, &m);
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MeshGetLocal(m, &l));
  OK(MeshCreateCurve(m, &curve));
  assert_non_null(curve);
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal x[MESH_MAX_NB * 3], at[3] = {0, 0, 0};

    OK(MeshCellCoordinates(m, c, x));
    for (PetscInt j = 0; j < l->nb; j++) {
      for (PetscInt a = 0; a < dim; a++)
        at[a] = x[l->nb / 2 * dim + a] + 0.999 * (x[j * dim + a] - x[l->nb / 2 * dim + a]);
      assert_int_equal(CurveOwner(curve, at), rank);
    }
  }
  OK(MeshDestroy(&m)); /* the curve outlives it */
  assert_in_range(CurveOwner(curve, (const PetscReal[3]){-5, 7, 1}), 0, 6);
  OK(CurveDestroy(&curve));
}

static void test_curve(void **state)
{
  (void)state;
  check_curve("-mesh_cells 12,20 -mesh_levels 2", 2);
  check_curve("-mesh_cells 10,6 -mesh_levels 1 -mesh_stretch 2,1", 2);
  check_curve("-mesh_dimension 3 -mesh_cells 3,5,4 -mesh_levels 2 -mesh_refine_distance 1", 3);
}

/* ---- trees in files ---- */

/* A tree that is read gives the mesh that the formula gives, to the last node, however ragged the tree is and wherever
   the ranks divide it */
static void test_restore(void **state)
{
  char path[PETSC_MAX_PATH_LEN];

  (void)state;
  OK(PetscSNPrintf(path, sizeof(path), "/tmp/tumble-tree-%d.h5", (int)total(getpid())));
  for (PetscInt i = 0; i < 4 * NTREES; i++) {
    const PetscInt   tree = i % NTREES, dim = tree < 3 ? 2 : 3;
    Balls            wanted = random_points(dim, 3 + i % 5, 100 + i), other = random_points(dim, 2, 200 + i);
    Mesh             m[2], old;
    const MeshLocal *l[2];
    State            s;

    for (PetscInt a = 0; a < 2; a++) wanted.period[a] = other.period[a] = tree == 1 || (tree == 4 && a == 1);
    for (PetscInt k = 0; k < 2; k++) {
      create(TREES[tree], k ? &other : &wanted, &m[k]);
      OK(MeshCreateState(m[k], &s));
      OK(k ? StateBeginLook(s, path) : StateBeginSave(s, path));
      OK(StateModule(s, "tree"));
      OK(k ? MeshRestore(m[1], s, &old) : MeshVisitTree(m[0], s));
      OK(StateEnd(s));
      OK(StateDestroy(&s));
    }
    assert_non_null(old);
    for (PetscInt k = 0; k < 2; k++) OK(MeshGetLocal(m[k], &l[k]));
    assert_int_equal(l[0]->ncell, l[1]->ncell);
    assert_int_equal(l[0]->ncell_all, l[1]->ncell_all);
    assert_int_equal(l[0]->nnode_all, l[1]->nnode_all);
    for (PetscInt c = 0; c < l[0]->ncell_all * l[0]->nb; c++) assert_int_equal(l[0]->cell_node[c], l[1]->cell_node[c]);
    NEAR(max_difference(l[0]->nnode_all * dim, l[0]->x, l[1]->x), 0, 0);
    OK(MeshDestroy(&old));
    for (PetscInt k = 0; k < 2; k++) OK(MeshDestroy(&m[k]));
  }
  (void)unlink(path);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_counts), cmocka_unit_test(test_places),
                                     cmocka_unit_test(test_ghosts), cmocka_unit_test(test_patch),
                                     cmocka_unit_test(test_carry),  cmocka_unit_test(test_carry_conserves),
                                     cmocka_unit_test(test_curve),  cmocka_unit_test(test_restore)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("refined", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
