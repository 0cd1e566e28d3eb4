/* Align, given surfaces that are no bodies: ellipses and ellipsoids that change their form, in the plane polygons that
   are sheared. Nodes lie on the surfaces to round-off, what is inside has their area and volume, with an inside that
   leaves the mesh and one that stays in it, through a periodic side, of two owners at once, on any number of ranks;
   surfaces keep their numbers when others vanish. */
/* ranks: 1 2 3 */
#include "core.h"
#include "align/align.h"
#include "align/join.h"
#include "base/algebra.h"
#include "fem/element.h"

#define MOST    3
#define NCORNER 5

/* n surfaces: ellipses with these half axes, or closed polygons through these corners, about their centres */
typedef struct {
  PetscInt         dim, number[MOST];
  PetscBool        own[MOST], inactive[MOST], polygon;
  PetscReal        centre[MOST][3], radius[MOST], round[MOST], volume[MOST];
  PetscReal        axis[MOST][3], corner[NCORNER][2];
  AlignSurfaces    table;
  Mesh             mesh;
  const MeshLocal *l;
  Align            align;
  PetscBool        wanted[MOST], aligned[MOST];
  AlignResult      r;
} Case;

/* ---- ellipses, ellipsoids ---- */

/* Closest point to r: y_a = axis_a^2 r_a/(t + axis_a^2), where the sum of (y_a/axis_a)^2 is 1, found by bisection */
static void closest(PetscInt dim, const PetscReal axis[3], const PetscReal r[3], PetscReal y[3])
{
  PetscReal least = PETSC_MAX_REAL, low, high = 0;

  for (PetscInt a = 0; a < dim; a++) {
    least = PetscMin(least, axis[a]);
    high += axis[a] * PetscAbsReal(r[a]);
  }
  low = -least * least;
  for (PetscInt step = 0; step < 200; step++) {
    const PetscReal t   = 0.5 * (low + high);
    PetscReal       sum = 0, size;

    for (PetscInt a = 0; a < dim; a++) {
      y[a] = axis[a] * axis[a] * r[a] / (t + axis[a] * axis[a]);
      sum += PetscSqr(y[a] / axis[a]);
    }
    if (sum > 1) low = t;
    else high = t;
    size = PetscSqrtReal(sum);
    for (PetscInt a = 0; a < dim; a++)
      y[a] /= size > 0 ? size : 1; /* on the surface, whatever is left of the bisection */
  }
}

/* ---- polygons ---- */

static void nearest_on_polygon(const Case *c, const PetscReal r[2], PetscReal y[2], PetscBool *inside)
{
  PetscReal best = PETSC_MAX_REAL;

  *inside = PETSC_FALSE;
  for (PetscInt i = 0; i < NCORNER; i++) {
    const PetscReal *p = c->corner[i], *q = c->corner[(i + 1) % NCORNER];
    const PetscReal  t[2] = {q[0] - p[0], q[1] - p[1]}, s[2] = {r[0] - p[0], r[1] - p[1]};
    const PetscReal  at = PetscMax(0, PetscMin(1, (t[0] * s[0] + t[1] * s[1]) / (t[0] * t[0] + t[1] * t[1])));
    const PetscReal  d2 = PetscSqr(s[0] - at * t[0]) + PetscSqr(s[1] - at * t[1]);

    if ((p[1] > r[1]) != (q[1] > r[1]) && r[0] < p[0] + (r[1] - p[1]) / t[1] * t[0]) *inside = (PetscBool) !*inside;
    if (d2 >= best) continue;
    best = d2;
    for (PetscInt a = 0; a < 2; a++) y[a] = p[a] + at * t[a];
  }
}

static PetscReal polygon_area(const Case *c)
{
  PetscReal sum = 0;

  for (PetscInt i = 0; i < NCORNER; i++) {
    const PetscReal *p = c->corner[i], *q = c->corner[(i + 1) % NCORNER];

    sum += 0.5 * (p[0] * q[1] - p[1] * q[0]);
  }
  return sum;
}

/* ---- the table ---- */

static void nearest(const Case *c, PetscInt k, const PetscReal r[], PetscReal y[], PetscReal *d)
{
  PetscReal sum = 0, way = 0;
  PetscBool inside;

  if (c->polygon) nearest_on_polygon(c, r, y, &inside);
  else {
    closest(c->dim, c->axis[k], r, y);
    for (PetscInt a = 0; a < c->dim; a++) sum += PetscSqr(r[a] / c->axis[k][a]);
    inside = (PetscBool)(sum < 1);
  }
  for (PetscInt a = 0; a < c->dim; a++) way += PetscSqr(r[a] - y[a]);
  *d = (inside ? -1 : 1) * PetscSqrtReal(way);
}

static PetscErrorCode distance(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                               PetscReal d[])
{
  const Case *c = (const Case *)ctx;

  for (PetscInt i = 0; i < m; i++) {
    PetscReal r[3] = {0}, y[3];

    for (PetscInt a = 0; a < c->dim; a++) r[a] = x[c->dim * i + a] - at[a];
    nearest(c, k, r, y, &d[i]);
  }
  return PETSC_SUCCESS;
}

static PetscErrorCode project(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[])
{
  const Case *c = (const Case *)ctx;

  for (PetscInt i = 0; i < m; i++) {
    PetscReal r[3] = {0}, to[3], d;

    for (PetscInt a = 0; a < c->dim; a++) r[a] = x[c->dim * i + a] - c->centre[k][a];
    nearest(c, k, r, to, &d);
    for (PetscInt a = 0; a < c->dim; a++) y[c->dim * i + a] = c->centre[k][a] + to[a];
  }
  return PETSC_SUCCESS;
}

static PetscErrorCode corners(void *ctx, PetscInt k, PetscInt most, PetscInt *m, PetscReal x[])
{
  const Case *c = (const Case *)ctx;

  *m = NCORNER;
  for (PetscInt i = 0; i < PetscMin(most, NCORNER); i++)
    for (PetscInt a = 0; a < 2; a++) x[2 * i + a] = c->centre[k][a] + c->corner[i][a];
  return PETSC_SUCCESS;
}

static void open_case(Case *c, PetscInt n, const char options[])
{
  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  c->dim = c->l->dim;
  for (PetscInt k = 0; k < MOST; k++) {
    c->number[k] = k;
    c->own[k] = c->wanted[k] = c->inactive[k] = PETSC_TRUE;
  }
  c->table = (AlignSurfaces){.ctx             = c,
                             .n               = n,
                             .nall            = n,
                             .largest         = 0.4,
                             .number          = c->number,
                             .own             = c->own,
                             .inactive_inside = c->inactive,
                             .centre          = (const PetscReal(*)[3])c->centre,
                             .radius          = c->radius,
                             .round           = c->round,
                             .volume          = c->volume,
                             .distance        = distance,
                             .project         = project};
  OK(AlignCreate(c->mesh, &c->table, &c->align));
}

static void close_case(Case *c)
{
  OK(AlignDestroy(&c->align));
  OK(MeshDestroy(&c->mesh));
}

/* What goes with the form of the surfaces */
static void measure(Case *c)
{
  for (PetscInt k = 0; k < c->table.n; k++) {
    c->volume[k] = c->dim == 2 ? PETSC_PI : 4 * PETSC_PI / 3;
    c->radius[k] = 0;
    for (PetscInt a = 0; a < c->dim; a++) {
      c->volume[k] *= c->axis[k][a];
      c->radius[k] = PetscMax(c->radius[k], c->axis[k][a]);
    }
    if (!c->polygon) continue;
    c->volume[k] = polygon_area(c);
    for (PetscInt i = 0; i < NCORNER; i++)
      c->radius[k] = PetscMax(c->radius[k], PetscHypotReal(c->corner[i][0], c->corner[i][1]));
  }
}

/* The mesh on them */
static void fit(Case *c)
{
  measure(c);
  OK(AlignFit(c->align, c->wanted, NULL, c->aligned, &c->r));
  OK(MeshMoveNodes(c->mesh, c->r.nnode, c->r.node, c->r.x));
}

/* Largest distance of a wall node from its surface; *n: how many there are */
static PetscReal miss(Case *c, PetscReal *n)
{
  PetscReal top = 0;

  *n = 0;
  for (PetscInt e = 0; e < c->r.nmarked; e++) {
    const PetscInt i = c->r.marked[e], k = c->r.node_surface[i];
    PetscReal      x[3] = {0}, d;

    if (!c->r.on_wall[i]) continue;
    for (PetscInt a = 0; a < c->dim; a++)
      x[a] = DomainNearest(c->l->period[a], c->l->x[c->dim * i + a], c->centre[k][a]);
    OK(distance(c, k, c->centre[k], 1, x, &d));
    top = PetscMax(top, PetscAbsReal(d));
    *n += i < c->l->nnode;
  }
  *n = total(*n);
  return largest(top);
}

/* Volume of the cells of surface k (-1: of none), and the smallest Jacobian of these over the largest at 3 points an
   axis */
static PetscReal volume(Case *c, PetscInt k, PetscReal *quality)
{
  const PetscReal g[3] = {-PetscSqrtReal(0.6), 0, PetscSqrtReal(0.6)}, w[3] = {5 / 9.0, 8 / 9.0, 5 / 9.0};
  PetscReal       sum = 0, worst = 1;

  for (PetscInt cell = 0; cell < c->l->ncell; cell++) {
    PetscReal xc[3 * MESH_MAX_NB], low = PETSC_MAX_REAL, high = 0;

    if (c->r.cell_surface[cell] != k) continue;
    OK(MeshCellCoordinates(c->mesh, cell, xc));
    for (PetscInt q = 0; q < (c->dim == 2 ? 9 : 27); q++) {
      const PetscReal xi[3] = {g[q % 3], g[q / 3 % 3], g[q / 9]};
      PetscReal       x[3], J[9], det;

      ElementMap(c->dim, xc, xi, x, J);
      det = DenseDeterminant(c->dim, J);
      sum += w[q % 3] * w[q / 3 % 3] * (c->dim == 2 ? 1 : w[q / 9]) * det;
      low  = PetscMin(low, det);
      high = PetscMax(high, det);
    }
    worst = PetscMin(worst, low / high);
  }
  *quality = -largest(-worst);
  return total(sum);
}

/* Cells inside surface k without a node on it that move all the same: they share what it takes from those beside it */
static PetscReal count_followers(Case *c, PetscInt k)
{
  const MeshLocal *l   = c->l;
  PetscReal        sum = 0;

  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    const PetscInt *node   = l->cell_node + cell * l->nb;
    const PetscInt  middle = node[l->nb / 2];
    PetscBool       wall   = PETSC_FALSE;

    for (PetscInt j = 0; j < l->nb; j++) wall = (PetscBool)(wall || c->r.on_wall[node[j]]);
    if (c->r.cell_surface[cell] != k || wall) continue;
    sum += l->x[c->dim * middle] != l->x_start[c->dim * middle] ||
           l->x[c->dim * middle + 1] != l->x_start[c->dim * middle + 1];
  }
  return total(sum);
}

/* ---- tests ---- */

/* Two ellipses that breathe, one of which keeps its inside as cells of the mesh; the error of the area falls with
   h^4 */
static void test_ellipses(void **state)
{
  PetscReal error[2] = {0, 0};

  (void)state;
  for (PetscInt fine = 0; fine < 2; fine++) {
    Case c = {0};

    open_case(&c, 2, fine ? "-mesh_cells 64,64" : "-mesh_cells 32,32");
    c.inactive[1] = PETSC_FALSE;
    for (PetscInt step = 0; step < 24; step++) {
      const PetscReal stretch = PetscExpReal(0.4 * PetscSinReal(0.5 * step));
      PetscReal       quality, count;

      for (PetscInt k = 0; k < 2; k++) {
        c.centre[k][0] = (k ? 0.72 : 0.28) + 0.02 * noise(2 * step + k);
        c.centre[k][1] = 0.5 + 0.02 * noise(200 + 2 * step + k);
        c.axis[k][0]   = 0.11 * (k ? stretch : 1 / stretch);
        c.axis[k][1]   = 0.11 / (k ? stretch : 1 / stretch);
      }
      fit(&c);
      assert_true(c.aligned[0] && c.aligned[1]);
      assert_true(c.r.inactive[0] && !c.r.inactive[1]);
      BELOW(miss(&c, &count), 1e-14);
      assert_true(count > (fine ? 100 : 50));
      for (PetscInt k = 0; k < 2; k++)
        error[fine] = PetscMax(error[fine], PetscAbsReal(volume(&c, k, &quality) / c.volume[k] - 1));
      assert_true(quality > 0.1); /* of the cells that stay */
      assert_true(count_followers(&c, 1) > (fine ? 30 : 5));
      assert_true(count_followers(&c, 0) == 0);
      NEAR(volume(&c, -1, &quality) + volume(&c, 0, &quality) + volume(&c, 1, &quality), 1, 1e-12);
    }
    close_case(&c);
  }
  BELOW(error[0], 2e-3);
  assert_true(error[1] < error[0] / 8);
}

/* A pentagon that is sheared to and fro: vertices on its corners, and as its sides are straight its area to
   round-off */
static void test_polygon(void **state)
{
  Case c = {.polygon = PETSC_TRUE};

  (void)state;
  open_case(&c, 1, "-mesh_cells 40,40");
  c.table.corners = corners;
  for (PetscInt step = 0; step < 24; step++) {
    PetscReal quality, count;

    c.inactive[0] = (PetscBool)(step % 2);
    for (PetscInt a = 0; a < 2; a++) c.centre[0][a] = 0.5 + 0.0125 * noise(2 * step + a);
    for (PetscInt i = 0; i < NCORNER; i++) {
      const PetscReal angle = 2 * PETSC_PI * (i + 0.3) / NCORNER;

      c.corner[i][1] = 0.2 * PetscSinReal(angle);
      c.corner[i][0] = 0.2 * PetscCosReal(angle) + 0.5 * PetscSinReal(0.4 * step) * c.corner[i][1];
    }
    fit(&c);
    assert_true(c.aligned[0]);
    assert_int_equal(c.r.ncut, 0);
    BELOW(miss(&c, &count), 1e-14);
    NEAR(volume(&c, 0, &quality), polygon_area(&c), 1e-12);
    if (!c.inactive[0]) assert_true(quality > 0.003);
  }
  close_case(&c);
}

/* An ellipse across a periodic side; and one that keeps its number while others vanish */
static void test_numbers(void **state)
{
  Case      c = {0};
  PetscReal quality, count, vanished = 0, kept = 0;

  (void)state;
  open_case(&c, 3, "-mesh_cells 40,40 -mesh_periodic x");
  for (PetscInt k = 0; k < 3; k++) {
    c.number[k]    = 3 + 2 * k;
    c.centre[k][0] = 0.02 + 0.33 * k;
    c.centre[k][1] = 0.5;
    c.axis[k][0]   = 0.1;
    c.axis[k][1]   = 0.13;
  }
  fit(&c);
  BELOW(miss(&c, &count), 1e-14);
  for (PetscInt k = 0; k < 3; k++) NEAR(volume(&c, k, &quality), c.volume[k], 1e-3 * c.volume[k]);
  c.table.n = 1; /* the last alone, which is called 0 from now on */
  for (PetscInt a = 0; a < 3; a++) {
    c.centre[0][a] = c.centre[2][a];
    c.axis[0][a]   = c.axis[2][a];
  }
  c.number[0] = 7;
  fit(&c);
  NEAR(volume(&c, 0, &quality), c.volume[0], 1e-3 * c.volume[0]);
  for (PetscInt cell = 0; cell < c.l->ncell; cell++) {
    kept += c.r.cell_before[cell] == 0 && c.r.cell_surface[cell] == 0;
    vanished += c.r.cell_before[cell] > 0;
  }
  assert_true(total(kept) > 20);
  assert_true(total(vanished) == 0);
  c.table.n = 0;
  fit(&c);
  for (PetscInt i = 0; i < 2 * c.l->nnode_all; i++) assert_true(c.l->x[i] == c.l->x_start[i]);
  close_case(&c);
}

/* The surfaces of two owners in one fit: an ellipse whose inside leaves the mesh, a pentagon whose inside stays */
static void test_joined(void **state)
{
  Case                       c = {0}, other = {.polygon = PETSC_TRUE};
  const AlignSurfaces *const table[2] = {&c.table, &other.table};
  PetscReal                  quality;
  AlignJoin                  join;

  (void)state;
  open_case(&other, 1, "-mesh_cells 8,8");
  open_case(&c, 1, "-mesh_cells 40,40");
  other.table.corners = corners;
  other.inactive[0]   = PETSC_FALSE;
  OK(AlignDestroy(&c.align));
  OK(AlignJoinCreate(PETSC_COMM_WORLD, 2, table, &join));
  OK(AlignJoinUpdate(join));
  OK(AlignCreate(c.mesh, AlignJoinGet(join), &c.align));
  for (PetscInt step = 0; step < 8; step++) {
    for (PetscInt a = 0; a < 2; a++) {
      c.centre[0][a]     = (a ? 0.5 : 0.28) + 0.0125 * noise(2 * step + a);
      c.axis[0][a]       = 0.12 + 0.04 * noise(100 + 2 * step + a);
      other.centre[0][a] = (a ? 0.5 : 0.7) + 0.0125 * noise(200 + 2 * step + a);
    }
    for (PetscInt i = 0; i < 2 * NCORNER; i++) {
      const PetscReal angle = 2 * PETSC_PI * (i / 2 + 0.3) / NCORNER;

      other.corner[i / 2][i % 2] = 0.17 * (i % 2 ? PetscSinReal(angle) : PetscCosReal(angle));
    }
    measure(&c);
    measure(&other);
    OK(AlignJoinUpdate(join));
    OK(AlignFit(c.align, c.wanted, NULL, c.aligned, &c.r));
    OK(MeshMoveNodes(c.mesh, c.r.nnode, c.r.node, c.r.x));
    assert_true(c.aligned[0] && c.aligned[1] && c.r.inactive[0] && !c.r.inactive[1]);
    assert_int_equal(AlignJoinGetFirst(join)[1], 1);
    NEAR(volume(&c, 0, &quality), c.volume[0], 1e-3 * c.volume[0]);
    NEAR(volume(&c, 1, &quality), other.volume[0], 1e-12);
  }
  OK(AlignJoinDestroy(&join));
  close_case(&other);
  close_case(&c);
}

/* An ellipsoid in space, its inside in the mesh or not */
static void test_ellipsoid(void **state)
{
  Case c = {0};

  (void)state;
  open_case(&c, 1, "-mesh_cells 12,12,12 -mesh_lower 0,0,0 -mesh_upper 1,1,1");
  for (PetscInt step = 0; step < 4; step++) {
    PetscReal quality, count;

    c.inactive[0] = (PetscBool)(step % 2);
    for (PetscInt a = 0; a < 3; a++) {
      c.centre[0][a] = 0.5 + 0.04 * noise(3 * step + a);
      c.axis[0][a]   = 0.27 + 0.05 * noise(100 + 3 * step + a);
    }
    fit(&c);
    assert_true(c.aligned[0]);
    assert_int_equal(c.r.inactive[0], c.inactive[0]);
    BELOW(miss(&c, &count), 1e-14);
    assert_true(count > 200);
    NEAR(volume(&c, 0, &quality), c.volume[0], 5e-3 * c.volume[0]);
    if (!c.inactive[0]) assert_true(quality > 0.002);
    NEAR(volume(&c, -1, &quality) + volume(&c, 0, &count), 1, 1e-12);
    assert_true(quality > 0.002);
  }
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_ellipses), cmocka_unit_test(test_polygon),
                                     cmocka_unit_test(test_numbers), cmocka_unit_test(test_joined),
                                     cmocka_unit_test(test_ellipsoid)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
