/* Place: first positions of the bodies of a group, see place.h.

   Lattice: of all splits of the box into nx x ny (x nz) cells that hold `count` bodies, the one with the widest
   smallest cell side. Random: sequential dart throwing; bodies are listed in a search grid with the distance that a
   new centre has to keep, so that a dart looks into one cell only. Lengths in the unit of the scene. Knows no
   shapes: bodies are kept apart by their bounding radius. */
#include "compat.h"
#include "shape/place.h"
#include "base/algebra.h"
#include "base/array.h"
#include "base/csv.h"
#include "base/grid.h"
#include "base/mix.h"

#define MAX_TRIES 20000 /* darts for one body before the box counts as full */

void PlaceTurn(const PetscReal axis[3], const PetscReal q[4], Placement *p)
{
  PetscReal about[3];

  for (PetscInt a = 0; a < 3; a++)
    about[a] = p->has_axis ? p->axis[a] / PetscSqrtReal(dot3(p->axis, p->axis)) : axis[a];
  for (PetscInt i = 0; i < 4 && !p->has_quaternion; i++) p->q[i] = q[i];
  RotationAdvance(p->angle, about, p->q); /* makes it a unit quaternion, too */
  p->turned = PETSC_TRUE;
}

/* ---- lattice ---- */

static PetscReal smallest_side(PetscInt dim, const PetscReal size[3], const PetscInt n[3])
{
  PetscReal side = PETSC_MAX_REAL;

  for (PetscInt a = 0; a < dim; a++) side = PetscMin(side, size[a] / n[a]);
  return side;
}

static void split_box(PetscInt dim, const PetscReal size[3], PetscInt count, PetscInt best[3], PetscReal *side)
{
  *side = -1;
  for (PetscInt nx = 1; nx <= count; nx++) {
    const PetscInt rows = (count + nx - 1) / nx;

    for (PetscInt ny = dim == 2 ? rows : 1; ny <= rows; ny++) {
      const PetscInt  n[3] = {nx, ny, (rows + ny - 1) / ny};
      const PetscReal s    = smallest_side(dim, size, n);

      if (s > *side) {
        *side = s;
        for (PetscInt a = 0; a < 3; a++) best[a] = n[a];
      }
    }
  }
}

PetscErrorCode PlaceLattice(const PlaceBox *in, PetscInt count, PetscInt n[3])
{
  const PetscReal needed  = 2 * in->radius + in->margin;
  PetscReal       size[3] = {0, 0, 0}, side;

  PetscFunctionBeginUser;
  n[0] = n[1] = n[2] = 1;
  if (!count) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < in->dim; a++) size[a] = in->upper[a] - in->lower[a];
  split_box(in->dim, size, count, n, &side);
  PetscCheck(side > needed, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Lattice of group '%s' does not fit: %" PetscInt_FMT
             " bodies leave cells of width %g, a body with margin needs more than %g. Lower -particle_%s_count or widen -particle_%s_lower .. _upper",
             in->name, count, (double)side, (double)needed, in->name, in->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

void PlaceOnLattice(const PlaceBox *in, const PetscInt n[3], PetscInt count, PetscInt i, PetscReal x[3])
{
  const PetscInt row = i / n[0], at[3] = {i % n[0], row % n[1], row / n[1]};
  const PetscInt in_row = PetscMin(n[0], count - row * n[0]); /* the last row may be short */

  for (PetscInt a = 0; a < 3; a++)
    x[a] = a < in->dim ? in->lower[a] + (in->upper[a] - in->lower[a]) * (at[a] + 0.5) / (a ? n[a] : in_row) : 0;
}

/* ---- random ---- */

PetscErrorCode ParticlesPlacedAdd(ParticlesPlaced *placed, PetscReal radius, PetscInt count, const Placement p[])
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(placed->n + count, &placed->capacity, &placed->x, sizeof(*placed->x), &placed->radius,
                         sizeof(*placed->radius), NULL));
  for (PetscInt i = 0; i < count; i++, placed->n++) {
    PetscCall(PetscArraycpy(placed->x[placed->n], p[i].x, 3));
    placed->radius[placed->n] = radius * p[i].scale;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticlesPlacedDestroy(ParticlesPlaced *placed)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(placed->x));
  PetscCall(PetscFree(placed->radius));
  placed->n = placed->capacity = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* splitmix64 (Steele, Lea, Flood 2014): uniform in [0, 1), the same on every machine */
PetscReal PlaceUniform(PetscInt64 *state)
{
  const uint64_t z = (uint64_t)*state + MIX_STEP;

  *state = (PetscInt64)z;
  return (PetscReal)((double)(Mix64(z) >> 11) / 9007199254740992.0);
}

PetscInt64 PlaceStream(PetscInt seed, PetscInt stream)
{
  PetscInt64 state = seed;

  for (PetscInt i = 0; i < stream; i++) (void)PlaceUniform(&state);
  return (PetscInt64)((unsigned long long)(1e15 * PlaceUniform(&state)) * 0xd1342543de82ef95ULL +
                      (unsigned long long)stream);
}

static PetscReal ball_volume(PetscInt dim, PetscReal r)
{
  return dim == 2 ? PETSC_PI * r * r : 4 * PETSC_PI / 3 * r * r * r;
}

/* keep[i]: distance a new centre has to keep from item i at x[i], for a body without size */
static PetscBool is_free(Grid cells, PetscInt dim, PetscReal (*x)[3], const PetscReal keep[], PetscReal radius,
                         const PetscReal y[3])
{
  for (PetscInt e = GridFirst(cells, y); e >= 0; e = GridNext(cells, e)) {
    const PetscInt i  = GridItem(cells, e);
    PetscReal      d2 = 0;

    for (PetscInt a = 0; a < dim; a++) d2 += PetscSqr(x[i][a] - y[a]);
    if (d2 <= PetscSqr(keep[i] + radius)) return PETSC_FALSE;
  }
  return PETSC_TRUE;
}

static PetscErrorCode throw_darts(Grid cells, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                  PetscReal radius, PetscReal (*x)[3], const PetscReal keep[], PetscInt64 *state,
                                  PetscReal y[3], PetscBool *found)
{
  PetscFunctionBeginUser;
  *found = PETSC_FALSE;
  for (PetscInt t = 0; t < MAX_TRIES && !*found; t++) {
    for (PetscInt a = 0; a < dim; a++)
      y[a] = lower[a] + radius + (upper[a] - lower[a] - 2 * radius) * PlaceUniform(state);
    *found = is_free(cells, dim, x, keep, radius, y);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Large bodies first, which small ones leave no room for; bodies of one size in their order */
static PetscErrorCode sort_by_size(PetscInt count, const Placement p[], PetscInt order[])
{
  PetscReal *size;
  PetscBool  differ = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(count, &size));
  for (PetscInt i = 0; i < count; i++) {
    order[i] = i;
    size[i]  = -p[i].scale;
    differ   = (PetscBool)(differ || size[i] != size[0]);
  }
  if (differ) PetscCall(PetscSortRealWithArrayInt(count, size, order));
  PetscCall(PetscFree(size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PlaceRandom(const PlaceBox *in, PetscInt seed, const ParticlesPlaced *others, PetscInt count,
                           Placement p[])
{
  const PetscInt   n     = others->n;
  const char      *name  = in->name;
  const PetscInt   dim   = in->dim;
  const PetscReal *lower = in->lower, *upper = in->upper, radius = in->radius, margin = in->margin;
  Grid             cells;
  PetscReal(*x)[3], *keep, box = 1, largest = 0, filled = 0;
  PetscInt64 state = seed;
  PetscInt  *order;
  PetscBool  found = PETSC_TRUE;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < count; i++) largest = PetscMax(largest, radius * p[i].scale);
  for (PetscInt a = 0; a < dim; a++) {
    PetscCheck(upper[a] - lower[a] >= 2 * largest, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Random bodies of group '%s': the box is %g wide along axis %" PetscInt_FMT
               ", one body needs %g. Widen -particle_%s_lower .. _upper",
               name, (double)(upper[a] - lower[a]), a, (double)(2 * largest), name);
    box *= upper[a] - lower[a];
  }
  PetscCall(PetscMalloc3(n + count, &x, n + count, &keep, count, &order));
  PetscCall(sort_by_size(count, p, order));
  PetscCall(GridCreate(dim, lower, upper, 2 * largest + margin, 4 * (n + count) + 64, &cells));
  for (PetscInt i = 0; i < n + count && found; i++) {
    const PetscReal r = i < n ? others->radius[i] : radius * p[order[i - n]].scale;

    if (i < n)
      for (PetscInt a = 0; a < 3; a++) x[i][a] = others->x[i][a];
    else {
      x[i][2] = 0;
      PetscCall(throw_darts(cells, dim, lower, upper, r, x, keep, &state, x[i], &found));
      PetscCheck(found, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "Random bodies of group '%s': only %" PetscInt_FMT " of %" PetscInt_FMT
                 " fit, they fill %.3g of the box. Lower -particle_%s_count or -particle_%s_margin, widen the box, or use -particle_%s_place lattice or "
                 "pack",
                 name, i - n, count, (double)(filled / box), name, name, name);
      PetscCall(PetscArraycpy(p[order[i - n]].x, x[i], 3));
      filled += ball_volume(dim, r);
    }
    keep[i] = margin + r;
    PetscCall(GridInsert(cells, i, x[i], keep[i] + largest));
  }
  PetscCall(GridDestroy(&cells));
  PetscCall(PetscFree3(x, keep, order));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- table ---- */

/* What a column of the table means */
typedef struct {
  const char *name;
  size_t      offset; /* where in a Placement it goes */
  PetscInt    dim;    /* smallest dimension in which it means something */
  PetscBool   positive;
} Column;

/* The orientation in 3D: all columns of a set or none; the angle turns about the axis */
static const char *const AXIS[] = {"axis_x", "axis_y", "axis_z", NULL}, *const QUATERNION[] = {"q_w", "q_x", "q_y",
                                                                                               "q_z", NULL};

static const Column COLUMNS[] = {{"x", offsetof(Placement, x), 2, PETSC_FALSE},
                                 {"y", offsetof(Placement, x) + sizeof(PetscReal), 2, PETSC_FALSE},
                                 {"angle", offsetof(Placement, angle), 2, PETSC_FALSE},
                                 {"u", offsetof(Placement, u), 2, PETSC_FALSE},
                                 {"v", offsetof(Placement, u) + sizeof(PetscReal), 2, PETSC_FALSE},
                                 {"omega", offsetof(Placement, omega) + 2 * sizeof(PetscReal), 2, PETSC_FALSE},
                                 {"size", offsetof(Placement, scale), 2, PETSC_TRUE},
                                 {"radius", offsetof(Placement, radius), 2, PETSC_TRUE},
                                 {"density", offsetof(Placement, density), 2, PETSC_TRUE},
                                 {"z", offsetof(Placement, x) + 2 * sizeof(PetscReal), 3, PETSC_FALSE},
                                 {"w", offsetof(Placement, u) + 2 * sizeof(PetscReal), 3, PETSC_FALSE},
                                 {"axis_x", offsetof(Placement, axis), 3, PETSC_FALSE},
                                 {"axis_y", offsetof(Placement, axis) + sizeof(PetscReal), 3, PETSC_FALSE},
                                 {"axis_z", offsetof(Placement, axis) + 2 * sizeof(PetscReal), 3, PETSC_FALSE},
                                 {"q_w", offsetof(Placement, q), 3, PETSC_FALSE},
                                 {"q_x", offsetof(Placement, q) + sizeof(PetscReal), 3, PETSC_FALSE},
                                 {"q_y", offsetof(Placement, q) + 2 * sizeof(PetscReal), 3, PETSC_FALSE},
                                 {"q_z", offsetof(Placement, q) + 3 * sizeof(PetscReal), 3, PETSC_FALSE}};

static PetscErrorCode find_column(const Csv *t, PetscInt dim, const char name[], const Column **column)
{
  PetscFunctionBeginUser;
  *column = NULL;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(COLUMNS); i++)
    if (!strcmp(COLUMNS[i].name, name) && COLUMNS[i].dim <= dim) *column = COLUMNS + i;
  PetscCheck(*column, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": column '%s' is not known (known in %" PetscInt_FMT
             "D: x, y, angle, u, v, omega, size, radius, density%s)",
             t->file, t->header, name, dim, dim == 3 ? ", z, w; axis_x, axis_y, axis_z; q_w, q_x, q_y, q_z" : "");
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *has: are all columns of a set there? Some of them are an error, as is a line in which they are all zero. */
static PetscErrorCode find_set(const Csv *t, const char *const name[], PetscBool *has)
{
  const char *missing = NULL;
  PetscInt    found   = 0, total;

  PetscFunctionBeginUser;
  for (total = 0; name[total]; total++) {
    if (CsvColumn(t, name[total]) >= 0) found++;
    else missing = name[total];
  }
  PetscCheck(!found || !missing, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": the columns %s .. %s belong together: '%s' is missing", t->file, t->header, name[0],
             name[total - 1], missing);
  *has = (PetscBool)(found > 0);
  for (PetscInt i = 0; i < t->nrow && *has; i++) {
    PetscReal sum = 0;

    for (PetscInt k = 0; k < total; k++) sum += PetscAbsReal(t->value[i * t->ncolumn + CsvColumn(t, name[k])]);
    PetscCheck(sum > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s:%" PetscInt_FMT ": %s .. %s are all zero: %s",
               t->file, t->line[i], name[0], name[total - 1],
               total == 3 ? "an axis needs a length"
                          : "a rotation is w = cos(a/2) and x,y,z = sin(a/2) times the axis");
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PlaceTable(const char file[], PetscInt dim, const Placement *base, PetscInt *n, Placement **p,
                          PetscBool *sizes, PetscBool *densities, PetscBool *angles)
{
  const char *const axes[] = {"x", "y", "z"};
  PetscBool         axis, quaternion;
  Csv               t;

  PetscFunctionBeginUser;
  PetscCall(CsvRead(file, dim == 3 ? "x,y,z" : "x,y", &t));
  PetscCall(PetscMalloc1(t.nrow, p));
  *n = t.nrow;
  for (PetscInt i = 0; i < t.nrow; i++) (*p)[i] = *base;
  for (PetscInt c = 0; c < t.ncolumn; c++) {
    const Column *column = NULL;

    PetscCall(find_column(&t, dim, t.name[c], &column));
    for (PetscInt i = 0; i < t.nrow; i++) {
      const PetscReal value = t.value[i * t.ncolumn + c];

      PetscCheck(value > 0 || !column->positive, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "%s:%" PetscInt_FMT ": %s %g must be positive", file, t.line[i], column->name, (double)value);
      *(PetscReal *)((char *)(*p + i) + column->offset) = value;
    }
  }
  for (PetscInt a = 0; a < dim; a++)
    PetscCheck(CsvColumn(&t, axes[a]) >= 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": the header line has no column '%s': add it", file, t.header, axes[a]);
  PetscCall(find_set(&t, AXIS, &axis));
  PetscCall(find_set(&t, QUATERNION, &quaternion));
  for (PetscInt i = 0; i < t.nrow; i++) {
    (*p)[i].has_axis       = axis;
    (*p)[i].has_quaternion = quaternion;
  }
  *sizes     = (PetscBool)(CsvColumn(&t, "size") >= 0 || CsvColumn(&t, "radius") >= 0);
  *densities = (PetscBool)(CsvColumn(&t, "density") >= 0);
  *angles    = (PetscBool)(axis || quaternion || CsvColumn(&t, "angle") >= 0);
  PetscCheck(CsvColumn(&t, "size") < 0 || CsvColumn(&t, "radius") < 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: the columns 'size' and 'radius' both give the size of a body: remove one", file);
  PetscCall(CsvDestroy(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}
