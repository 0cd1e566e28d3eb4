/* Scalars, what goes by the values of scalars: sources (reactions), fluxes through boundaries and other sides (surface
   reactions). In a solve each is linear in the scalar that it feeds, q - s T: s is what it loses with its own value,
   by a difference, at least 0. It is taken where the step began, and there a stiff one's q, too, which stays stable;
   other q where the step is expected to lead: second order both. Other scalars count as solved for in the step, or
   extrapolated. */
#include "compat.h"
#include "impl.h"

#define DIFFERENCE 1e-7 /* of a value, over the largest */
#define SETTLED    1e-8 /* of the largest source; in time -scalars_rtol */

/* Values at points, of scalars at the point theta of the step; of the scalar itself as the step began, NULL: linear
   about its value */
typedef struct {
  PetscReal *of[EXPR_FIELDS], *start, largest;
} Fields;

typedef struct {
  Expr                 formula;
  PetscInt             n;
  const PetscReal     *x;       /* [n][dim] */
  const ScalarSurface *surface; /* in whose frame the formula has them, NULL: in space */
  PetscReal            stiff;   /* slope from which on it acts faster than a step */
} Points;

/* ---- values ---- */

static PetscErrorCode create_fields(Scalars all, const Scalar *s, PetscInt n, Fields *f)
{
  PetscFunctionBeginUser;
  *f = (Fields){.largest = 0};
  for (PetscInt k = 0; k < all->n; k++) PetscCall(PetscMalloc1(n, &f->of[k]));
  if (!s->solved) PetscCall(PetscMalloc1(n, &f->start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_fields(Scalars all, Fields *f)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < all->n; k++) PetscCall(PetscFree(f->of[k]));
  PetscCall(PetscFree(f->start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* At node i, as solved for, so that what one loses the other gains; else extrapolated */
static PetscReal get_value(Scalars all, const Scalar *of, PetscInt i)
{
  const PetscReal theta = all->step.theta;

  return of->solved ? theta * of->x[i] + (1 - theta) * of->T[i]
                    : of->T[i] + all->step.extrapolation * (of->T[i] - of->T_old[i]);
}

/* Of nodes */
static PetscErrorCode get_nodal(Scalars all, const Scalar *s, Fields *f)
{
  const PetscInt n = all->loc->nnode_all;

  PetscFunctionBeginUser;
  PetscCall(create_fields(all, s, n, f));
  for (PetscInt i = 0; i < n; i++) {
    for (PetscInt k = 0; k < all->n; k++) f->of[k][i] = get_value(all, all->scalar + k, i);
    if (f->start) f->start[i] = s->T[i];
    f->largest = PetscMax(f->largest, PetscAbsReal(s->T[i]));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &f->largest, 1, MPIU_REAL, MPIU_MAX, all->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal interpolate(const MeshLocal *l, PetscInt c, const PetscReal nodal[], const PetscReal phi[])
{
  PetscReal v[MESH_MAX_NB], value = 0;

  MeshCellValues(l, c, 1, nodal, v);
  for (PetscInt j = 0; j < l->nb; j++) value += phi[j] * v[j];
  return value;
}

/* Of n points of cell c with the bases phi [n][MESH_MAX_NB], from number `first` on */
static void set_at_points(Scalars all, PetscInt c, PetscInt n, const PetscReal phi[], const Fields *nodal,
                          PetscInt first, Fields *f)
{
  f->largest = nodal->largest;
  for (PetscInt q = 0; q < n; q++) {
    for (PetscInt k = 0; k < all->n; k++)
      f->of[k][first + q] = interpolate(all->loc, c, nodal->of[k], phi + q * MESH_MAX_NB);
    if (f->start) f->start[first + q] = interpolate(all->loc, c, nodal->start, phi + q * MESH_MAX_NB);
  }
}

/* ---- linear forms ---- */

/* The point theta of the step */
static PetscReal get_time(Scalars all)
{
  return all->step.time - (1 - all->step.theta) * all->step.dt;
}

static PetscErrorCode evaluate(Scalars all, const Points *p, PetscReal *const field[], PetscReal q[])
{
  const PetscInt  dim  = all->loc->dim;
  const PetscReal time = get_time(all);

  PetscFunctionBeginUser;
  if (!p->surface) {
    PetscCall(ExprEvaluateFields(p->formula, time, p->n, p->x, (const PetscReal *const *)field, q));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt i = 0; i < p->n; i++) {
    PetscReal        variable[EXPR_VARIABLES] = {0}, value[EXPR_FIELDS] = {0}, r[3] = {0, 0, 0};
    const PetscReal *R = p->surface->R;

    for (PetscInt a = 0; a < dim; a++) r[a] = MeshNearest(all->loc, a, p->x[i * dim + a] - p->surface->X[a]);
    for (PetscInt a = 0; a < dim; a++)
      variable[EXPR_X + a] = p->surface->origin[a] + R[a] * r[0] + R[3 + a] * r[1] + R[6 + a] * r[2];
    variable[EXPR_TIME] = time;
    for (PetscInt k = 0; k < all->n && field[k]; k++) value[k] = field[k][i];
    PetscCall(ExprEvaluateAt(p->formula, variable, value, q + i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A source with this slope takes up a scalar within about a step */
static PetscReal get_stiff(Scalars all, const Scalar *s)
{
  return s->par.capacity * all->step.ct / all->step.theta;
}

/* q - slope T at the points, T of scalar s */
static PetscErrorCode linearise(Scalars all, const Scalar *s, const Points *p, const Fields *f, PetscReal q[],
                                PetscReal slope[])
{
  const PetscInt  own  = (PetscInt)(s - all->scalar);
  const PetscReal step = DIFFERENCE * (f->largest > 0 ? f->largest : 1), *start = f->start ? f->start : f->of[own];
  PetscReal      *field[EXPR_FIELDS], *at, *next;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(slope, p->n));
  if (!ExprUsesField(p->formula, own)) {
    PetscCall(evaluate(all, p, f->of, q));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc2(p->n, &at, p->n, &next));
  PetscCall(PetscArraycpy(field, f->of, all->n));
  field[own] = at;
  PetscCall(PetscArraycpy(at, start, p->n));
  PetscCall(evaluate(all, p, field, q));
  for (PetscInt i = 0; i < p->n; i++) at[i] = start[i] + step;
  PetscCall(evaluate(all, p, field, next));
  for (PetscInt i = 0; i < p->n; i++) {
    slope[i] = PetscMax(0, (q[i] - next[i]) / (at[i] - start[i]));
    at[i]    = slope[i] > p->stiff ? start[i] : f->of[own][i];
  }
  PetscCall(evaluate(all, p, field, q));
  for (PetscInt i = 0; i < p->n; i++) q[i] += slope[i] * at[i];
  PetscCall(PetscFree2(at, next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* q of nodes: the option's, and c r T of every scalar that makes this one */
static PetscErrorCode set_source(Scalars all, Scalar *s, const Fields *f)
{
  const PetscInt n = all->loc->nnode_all;

  PetscFunctionBeginUser;
  if (!s->source.given && !s->gain) PetscFunctionReturn(PETSC_SUCCESS);
  if (!s->input.q) PetscCall(PetscMalloc1(n, &s->input.q));
  if (ExprUsesFields(s->source.formula)) {
    if (!s->input.slope) PetscCall(PetscMalloc1(n, &s->input.slope));
    PetscCall(linearise(all, s, &(Points){s->source.formula, n, all->loc->x, NULL, get_stiff(all, s)}, f, s->input.q,
                        s->input.slope));
  } else PetscCall(ScalarEvaluateNumber(&s->source, get_time(all), n, all->loc->x, s->input.q));
  for (PetscInt k = 0; k < all->n && s->gain; k++) {
    const PetscReal rate = s->par.capacity * s->gain[k];

    for (PetscInt i = 0; i < n && rate != 0; i++) s->input.q[i] += rate * f->of[k][i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Flux q + h ambient and transfer h at the points of the faces of boundary b, at the point theta of the step */
static PetscErrorCode set_boundary(Scalars all, Scalar *s, PetscInt b, const Fields *nodal)
{
  const PetscInt         dim = all->loc->dim, nq = dim == 2 ? 3 : 9, most = all->nface * nq;
  const ScalarCondition *c    = s->condition + b;
  const PetscBool        uses = ExprUsesFields(c->flux.formula);
  PetscInt               n    = 0, *face;
  PetscReal             *x, *flux, *ambient, *slope, weight[9], phi[9 * MESH_MAX_NB];
  Fields                 f = {.start = NULL};

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc5(all->nface, &face, most * dim, &x, most, &flux, most, &ambient, most, &slope));
  if (uses) PetscCall(create_fields(all, s, most, &f));
  for (PetscInt i = 0; i < all->nface; i++) {
    if (all->face[i].boundary != b) continue;
    PetscCall(ScalarFacePoints(all, i, x + n * nq * dim, weight, phi));
    if (uses) set_at_points(all, all->face[i].cell, nq, phi, nodal, n * nq, &f);
    face[n++] = i;
  }
  f.largest = nodal->largest;
  PetscCall(PetscArrayzero(slope, most));
  if (uses)
    PetscCall(
      linearise(all, s, &(Points){c->flux.formula, n * nq, x, NULL, get_stiff(all, s) * all->loc->h}, &f, flux, slope));
  else PetscCall(ScalarEvaluateNumber(&c->flux, get_time(all), n * nq, x, flux));
  PetscCall(ScalarEvaluateNumber(&c->ambient, get_time(all), n * nq, x, ambient));
  for (PetscInt i = 0; i < n * nq; i++) {
    PetscReal *has = s->input.face + (face[i / nq] * nq + i % nq) * 2;

    has[0] = flux[i] + c->transfer * ambient[i];
    has[1] = c->transfer + slope[i];
  }
  PetscCall(free_fields(all, &f));
  PetscCall(PetscFree5(face, x, flux, ambient, slope));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same at the points of other sides */
static PetscErrorCode set_sides(Scalars all, Scalar *s, const Fields *nodal)
{
  const PetscInt nq = all->loc->dim == 2 ? 3 : 9;
  Fields         f  = {.start = NULL};

  PetscFunctionBeginUser;
  if (!s->nside) PetscFunctionReturn(PETSC_SUCCESS);
  if (!s->input.side) PetscCall(PetscMalloc1(s->nside * nq * 2, &s->input.side));
  if (s->input.reacts) PetscCall(create_fields(all, s, nq, &f));
  for (PetscInt i = 0; i < s->nside; i++) {
    const ScalarSide *side = s->side + i;
    PetscReal         x[27], weight[9], phi[9 * MESH_MAX_NB], q[9], slope[9] = {0};
    Points            p;

    for (PetscInt k = 0; k < nq; k++) q[k] = side->q;
    if (side->surface) {
      PetscCall(ScalarSidePoints(all, side->cell, side->side, x, weight, phi, NULL));
      if (s->input.reacts) set_at_points(all, side->cell, nq, phi, nodal, 0, &f);
      p = (Points){side->surface->flux, nq, x, side->surface, get_stiff(all, s) * all->loc->h};
      PetscCall(linearise(all, s, &p, &f, q, slope));
    }
    for (PetscInt k = 0; k < nq; k++) {
      s->input.side[(i * nq + k) * 2]     = q[k];
      s->input.side[(i * nq + k) * 2 + 1] = side->h + slope[k];
    }
  }
  PetscCall(free_fields(all, &f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Samples of cell c in the layer of a surface with a flux: their numbers k [n], positions x [n][dim], bases phi
   [n][MESH_MAX_NB] */
static PetscErrorCode find_layer(Scalars all, PetscInt c, const ScalarSamples *p, PetscInt *n, PetscInt k[],
                                 PetscReal x[], PetscReal phi[])
{
  const PetscInt dim = all->loc->dim;
  PetscReal      xc[MESH_MAX_NB * 3], g[3][MESH_MAX_NB];

  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(ScalarCellCoordinates(all, c, xc));
  for (PetscInt i = 0; i < PetscPowInt(p->n, dim); i++) {
    PetscReal *basis = phi + *n * MESH_MAX_NB;

    if (p->layer[i] == 0) continue;
    (void)ScalarSampleBasis(all, p->n, i, xc, basis, g);
    for (PetscInt a = 0; a < dim; a++) {
      x[*n * dim + a] = 0;
      for (PetscInt j = 0; j < all->loc->nb; j++) x[*n * dim + a] += basis[j] * xc[j * dim + a];
    }
    k[(*n)++] = i;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The flux of the surface that cuts cell c, at its samples: has [count][2] */
static PetscErrorCode set_layer(Scalars all, Scalar *s, PetscInt c, const ScalarSamples *p, const Fields *nodal,
                                PetscReal has[])
{
  const PetscInt most = s->input.count;
  PetscInt       n, *k;
  PetscReal     *x, *phi, *q, *slope;
  Fields         f = {.start = NULL};
  Points         points;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc5(most, &k, most * 3, &x, most * MESH_MAX_NB, &phi, most, &q, most, &slope));
  PetscCall(find_layer(all, c, p, &n, k, x, phi));
  if (s->input.reacts) PetscCall(create_fields(all, s, n, &f));
  if (s->input.reacts) set_at_points(all, c, n, phi, nodal, 0, &f);
  points = (Points){p->surface->flux, n, x, p->surface, get_stiff(all, s) * all->loc->h};
  PetscCall(linearise(all, s, &points, &f, q, slope));
  for (PetscInt i = 0; i < n; i++) {
    has[2 * k[i]]     = p->layer[k[i]] * q[i];
    has[2 * k[i] + 1] = p->layer[k[i]] * slope[i];
  }
  PetscCall(free_fields(all, &f));
  PetscCall(PetscFree5(k, x, phi, q, slope));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The samples of a cell if a surface with a flux cuts it, else NULL */
static const ScalarSamples *get_cut(const Scalar *s, PetscInt c)
{
  const ScalarSamples *p = s->cells.sample && s->cells.sample[c] >= 0 ? s->cells.samples + s->cells.sample[c] : NULL;

  return p && p->surface ? p : NULL;
}

static PetscErrorCode set_layers(Scalars all, Scalar *s, const Fields *nodal)
{
  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < all->loc->ncell_all; c++) {
    const ScalarSamples *p = get_cut(s, c);

    if (!p) continue;
    s->input.count = PetscPowInt(p->n, all->loc->dim);
    if (!s->input.sample) PetscCall(PetscCalloc1(s->cells.nsample * s->input.count * 2, &s->input.sample));
    PetscCall(set_layer(all, s, c, p, nodal, s->input.sample + s->cells.sample[c] * s->input.count * 2));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarSetInput(Scalars all, Scalar *s)
{
  const PetscInt nq    = all->loc->dim == 2 ? 3 : 9;
  Fields         nodal = {.start = NULL};

  PetscFunctionBeginUser;
  if (s->input.reacts) PetscCall(get_nodal(all, s, &nodal));
  PetscCall(set_source(all, s, &nodal));
  for (PetscInt b = 0; b < all->nboundary; b++) {
    if (s->condition[b].kind != SCALAR_FLUX) continue;
    if (!s->input.face) PetscCall(PetscCalloc1(all->nface * nq * 2, &s->input.face));
    PetscCall(set_boundary(all, s, b, &nodal));
  }
  PetscCall(set_sides(all, s, &nodal));
  PetscCall(set_layers(all, s, &nodal));
  PetscCall(free_fields(all, &nodal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ScalarHasSink(Scalars all, const Scalar *s)
{
  const PetscInt nq  = all->loc->dim == 2 ? 3 : 9;
  PetscBool      any = PETSC_FALSE;

  for (PetscInt i = 0; i < all->loc->nnode && s->input.slope; i++) any = (PetscBool)(any || s->input.slope[i] > 0);
  for (PetscInt i = 0; i < all->nface * nq && s->input.face; i++)
    any = (PetscBool)(any || s->input.face[2 * i + 1] > 0);
  for (PetscInt i = 0; i < s->nside * nq; i++) any = (PetscBool)(any || s->input.side[2 * i + 1] > 0);
  for (PetscInt i = 0; i < s->cells.nsample * s->input.count && s->input.sample; i++)
    any = (PetscBool)(any || s->input.sample[2 * i + 1] > 0);
  return any;
}

PetscErrorCode ScalarForgetInput(ScalarInput *input)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(input->q));
  PetscCall(PetscFree(input->slope));
  PetscCall(PetscFree(input->face));
  PetscCall(PetscFree(input->side));
  PetscCall(PetscFree(input->sample));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- again ---- */

/* change[0] at least by how much q - s T differs from what it was, change[1] at least its size */
static void compare(PetscReal q, PetscReal slope, PetscReal q_was, PetscReal slope_was, PetscReal T,
                    PetscReal change[2])
{
  change[0] = PetscMax(change[0], PetscAbsReal(q - slope * T - q_was + slope_was * T));
  change[1] = PetscMax(change[1], PetscAbsReal(q - slope * T));
}

/* The same of the points of a side */
static void compare_side(Scalars all, PetscInt c, const PetscReal phi[], const PetscReal T[], const PetscReal has[],
                         const PetscReal was[], PetscReal change[2])
{
  for (PetscInt q = 0; q < (all->loc->dim == 2 ? 3 : 9); q++)
    compare(has[2 * q], has[2 * q + 1], was[2 * q], was[2 * q + 1], interpolate(all->loc, c, T, phi + q * MESH_MAX_NB),
            change);
}

/* The same of the samples of cells that surfaces with a flux cut */
static PetscErrorCode compare_layers(Scalars all, const Scalar *s, const PetscReal T[], const PetscReal was[],
                                     PetscReal change[2])
{
  const PetscInt most = s->input.count;
  PetscReal     *x, *phi;
  PetscInt      *k, n;

  PetscFunctionBeginUser;
  if (!s->input.sample) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc3(most, &k, most * 3, &x, most * MESH_MAX_NB, &phi));
  for (PetscInt c = 0; c < all->loc->ncell; c++) {
    const ScalarSamples *p = get_cut(s, c);

    if (!p) continue;
    PetscCall(find_layer(all, c, p, &n, k, x, phi));
    for (PetscInt i = 0; i < n; i++) {
      const PetscInt e = (s->cells.sample[c] * most + k[i]) * 2;

      compare(s->input.sample[e], s->input.sample[e + 1], was[e], was[e + 1],
              interpolate(all->loc, c, T, phi + i * MESH_MAX_NB), change);
    }
  }
  PetscCall(PetscFree3(k, x, phi));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Have sources and fluxes of a scalar changed from what they were? Collective. */
static PetscErrorCode have_changed(Scalars all, const Scalar *s, const ScalarInput *was, PetscBool *changed)
{
  const MeshLocal *l         = all->loc;
  const PetscInt   nq        = l->dim == 2 ? 3 : 9;
  const PetscReal  bound     = all->step.ct > 0 ? all->rtol : SETTLED;
  PetscReal        change[8] = {0}, x[27], weight[9], phi[9 * MESH_MAX_NB], *T;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &T));
  for (PetscInt i = 0; i < l->nnode_all; i++) T[i] = get_value(all, s, i);
  for (PetscInt i = 0; i < l->nnode && s->input.q; i++)
    if (s->seen[i])
      compare(s->input.q[i], s->input.slope ? s->input.slope[i] : 0, was->q[i], s->input.slope ? was->slope[i] : 0,
              T[i], change);
  for (PetscInt i = 0; i < all->nface && s->input.face; i++) {
    PetscCall(ScalarFacePoints(all, i, x, weight, phi));
    compare_side(all, all->face[i].cell, phi, T, s->input.face + 2 * i * nq, was->face + 2 * i * nq, change + 2);
  }
  for (PetscInt i = 0; i < s->nside; i++) {
    PetscCall(ScalarSidePoints(all, s->side[i].cell, s->side[i].side, x, weight, phi, NULL));
    compare_side(all, s->side[i].cell, phi, T, s->input.side + 2 * i * nq, was->side + 2 * i * nq, change + 4);
  }
  PetscCall(compare_layers(all, s, T, was->sample, change + 6));
  PetscCall(PetscFree(T));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, change, 8, MPIU_REAL, MPIU_MAX, all->comm));
  *changed = PETSC_FALSE;
  for (PetscInt k = 0; k < 8; k += 2) *changed = (PetscBool)(*changed || change[k] > bound * change[k + 1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarRenewInput(Scalars all, Scalar *s, PetscBool *changed)
{
  ScalarInput other = s->input;

  PetscFunctionBeginUser;
  s->input = (ScalarInput){.reacts = other.reacts};
  PetscCall(ScalarSetInput(all, s));
  PetscCall(have_changed(all, s, &other, changed));
  if (!*changed) {
    const ScalarInput now = s->input;

    s->input = other;
    other    = now;
  }
  PetscCall(ScalarForgetInput(&other));
  PetscFunctionReturn(PETSC_SUCCESS);
}
