/* Flow: rows of the velocity matrix that are gathered around marked nodes are the matrix's, on boxes, on meshes whose
   cells are no parallelograms and where nodes hang, in 2D and 3D, with further terms, also of ghost nodes. */
/* ranks: 1 2 3 */
#include "core.h"
#include "flow/flow.h"
#include "gathered.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  const MeshLocal *l;
} Case;

/* The second step of a flow that is noise; the fluid domain is [0, 1.5] x [0, 1] (x [0, 1]) */
static void open_case(Case *c, PetscInt dim, PetscBool skewed, const char options[])
{
  const PetscInt n[3] = {dim == 2 ? 5 : 3, dim == 2 ? 4 : 3, 3};
  PetscReal     *u, *p;
  char           all[512];

  OK(PetscSNPrintf(all, sizeof(all), "-flow_density 3 -flow_viscosity 0.7 %s -mesh_dimension %d %s", options, (int)dim,
                   dim == 2 ? "-mesh_cells 5,4 -mesh_upper 1.5,1" : "-mesh_cells 3,3,3 -mesh_upper 1.5,1,1"));
  give(skewed ? "-flow_density 3 -flow_viscosity 0.7" : all);
  if (skewed) create_skewed_mesh(dim, n, &c->mesh);
  else OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(PetscCalloc2(c->l->nnode_all * dim, &u, c->l->ncell * (dim + 1), &p));
  fill_noise(c->l, 5, u);
  OK(FlowBeginStep(c->flow, 0.1, 0.1));
  OK(FlowAcceptStep(c->flow, u, p));
  OK(FlowBeginStep(c->flow, 0.25, 0.15));
  OK(PetscFree2(u, p));
}

static void close_case(Case *c)
{
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* Further terms in all local cells, ghosts too, and two in some */
static PetscInt make_terms(const MeshLocal *l, PetscInt **cells, PetscReal **terms)
{
  const PetscInt nn = l->nb * l->nb;
  PetscInt       n  = 0;

  OK(PetscMalloc2(2 * l->ncell_all, cells, 2 * l->ncell_all * nn, terms));
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt c = 0; c < l->ncell_all; c++) {
      if (l->cell_global[c] % 2 < pass) continue;
      (*cells)[n] = c;
      for (PetscInt e = 0; e < nn; e++) (*terms)[n * nn + e] = 0.1 * noise((2 * l->cell_global[c] + pass) * nn + e);
      n++;
    }
  }
  return n;
}

enum {
  BALL,
  OWN_CHOICE, /* every rank marks what it likes */
  NONE,
  EVERY,
  NCHOICES
};

static PetscBool is_marked(const MeshLocal *l, PetscInt i, PetscInt choice, PetscInt rank)
{
  PetscReal r2 = 0;

  for (PetscInt d = 0; d < l->dim; d++) r2 += PetscSqr(l->x[i * l->dim + d] - 0.55);
  if (choice == BALL) return (PetscBool)(r2 < 0.06);
  if (choice == OWN_CHOICE) return (PetscBool)(noise(97 * l->node_global[i] + rank) > 0.9);
  return (PetscBool)(choice == EVERY);
}

/* With further terms, and then without: what is kept from one call to the next must not matter */
static void check_rows(Case *c)
{
  PetscReal  *terms;
  PetscBool  *marked;
  PetscInt   *cells, n = make_terms(c->l, &cells, &terms);
  PetscMPIInt rank;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(PetscMalloc1(c->l->nnode_all, &marked));
  for (PetscInt pass = 0; pass < 2; pass++) {
    OK(FlowAddCellTerms(c->flow, c, pass ? 0 : n, pass ? NULL : cells, pass ? NULL : terms));
    OK(FlowAssemble(c->flow));
    for (PetscInt choice = 0; choice < NCHOICES; choice++) {
      PetscReal nmarked = 0, nghost;

      for (PetscInt i = 0; i < c->l->nnode_all; i++) {
        marked[i] = is_marked(c->l, i, choice, rank);
        nmarked += marked[i];
      }
      nghost = total((PetscReal)compare_rows(c->flow, c->l, marked));
      assert_int_equal(total(nmarked) > 0, choice != NONE);
      if (choice == EVERY || choice == NONE)
        assert_int_equal(nghost > 0, choice == EVERY && c->l->ncell_global > c->l->ncell);
    }
  }
  OK(FlowAddCellTerms(c->flow, c, 0, NULL, NULL));
  OK(PetscFree2(cells, terms));
  OK(PetscFree(marked));
}

static void test_rows(void **state)
{
  static const char *const options[] = {"", "-flow_velocity_operator matrix_free", "-flow_convection 0",
                                        "-mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0.4,0.4"};

  (void)state;
  for (PetscInt i = 0; i < 10; i++) { /* of each of the options, and skewed, in the plane and in space */
    const PetscBool space = (PetscBool)(i % 2), hangs = (PetscBool)(i / 2 == 3);
    Case            c;

    open_case(&c, 2 + space, (PetscBool)(i / 2 == 4),
              hangs && space ? "-mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.4,0.4"
                             : options[i / 2 % 4]);
    assert_int_equal(c.l->hang != NULL, hangs);
    check_rows(&c);
    close_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_rows)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("rows", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
