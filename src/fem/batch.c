/* Batch: see batch.h. Kernels are written for a general dimension and inlined with constants.

   Coefficients of boxes: mass, diffusion along each axis, then for every point the convection along each reference axis
   [dim] and, with skew, that of the divergence, and with `vary` the factor of the diffusion, which stands for b + nu.
   Of other cells, for every point: mass, diffusion tensor (upper triangle
   by rows), convection, divergence. Quadrature weights are in all but the first two of boxes. */
#include "compat.h"
#include "fem/batch.h"
#include "base/inline.h"

#define NPOINT(dim)  ((dim) == 2 ? 9 : 27)
#define NTENSOR(dim) ((dim) * ((dim) + 1) / 2)
#define AT           0.77459666924148337704 /* the outer points on a line, sqrt(3/5) */

void BatchSetTables(PetscInt dim, BatchTables *t)
{
  const PetscReal point[3] = {-AT, 0, AT}, weight[3] = {5.0 / 9, 8.0 / 9, 5.0 / 9},
                  norm[3] = {1.0 / 18, 1.0 / 6, 2.0 / 45};

  t->dim = dim;
  t->n   = NPOINT(dim);
  for (PetscInt q = 0; q < 3; q++) {
    PetscReal v[3], dv[3];

    ElementLine(point[q], v, dv);
    for (PetscInt j = 0; j < 3; j++) {
      t->pair[0][j][q] = v[j] * v[j];
      t->pair[1][j][q] = v[j] * dv[j];
      t->pair[2][j][q] = dv[j] * dv[j];
    }
  }
  for (PetscInt q = 0; q < t->n; q++) {
    const PetscInt qd[3] = {q % 3, q / 3 % 3, q / 9};

    t->weight[q] = 1;
    t->norm[q]   = 1;
    for (PetscInt d = 0; d < dim; d++) {
      t->weight[q] *= weight[qd[d]];
      t->norm[q] *= norm[qd[d]];
    }
  }
}

PetscInt BatchCoefficients(const BatchTables *t, const BatchForm *f)
{
  const PetscInt flow = f->convection ? t->dim + (f->skew != 0) : 0;

  return f->box ? 1 + t->dim + t->n * (flow + (f->vary ? 1 : 0)) : t->n * (1 + NTENSOR(t->dim) + flow);
}

/* Matrices of three values on a line: from nodes to points, from values at the points to derivatives there, both
   transposed; from nodes to 6, 2 and 3 times the coefficients of the Legendre polynomials */
typedef enum {
  VALUE,
  VALUE_T,
  SLOPE,
  SLOPE_T,
  EXPAND
} Line;

/* The matrix times (a, b, c), by even and odd parts */
INLINE void turn(const Line which, Lanes *a, Lanes *b, Lanes *c)
{
  const Lanes sum = *a + *c, odd = *c - *a, middle = *b;

  switch (which) {
  case VALUE:
    *a = (0.3 * sum + 0.4 * middle) - 0.5 * AT * odd;
    *c = (0.3 * sum + 0.4 * middle) + 0.5 * AT * odd;
    break;
  case VALUE_T:
    *a = 0.3 * sum - 0.5 * AT * odd;
    *b = middle + 0.4 * sum;
    *c = 0.3 * sum + 0.5 * AT * odd;
    break;
  case SLOPE:
    *a = 0.5 / AT * odd - 1 / AT * (sum - 2 * middle);
    *b = 0.5 / AT * odd;
    *c = 0.5 / AT * odd + 1 / AT * (sum - 2 * middle);
    break;
  case SLOPE_T:
    *a = 1 / AT * odd - 0.5 / AT * (sum + middle);
    *b = -2 / AT * odd;
    *c = 1 / AT * odd + 0.5 / AT * (sum + middle);
    break;
  case EXPAND:
    *a = sum + 4 * middle;
    *b = odd;
    *c = sum - 2 * middle;
    break;
  }
}

/* out = (add: +=) the matrix along an axis of in */
INLINE void contract(const int dim, const int axis, const PetscBool add, const Line which, const Lanes *in, Lanes *out)
{
  const int s = axis == 0 ? 1 : axis == 1 ? 3 : 9;

  for (int line = 0; line < NPOINT(dim) / 3; line++) {
    const int at = line / s * 3 * s + line % s;
    Lanes     a = in[at], b = in[at + s], c = in[at + 2 * s];

    turn(which, &a, &b, &c);
    out[at]         = add ? out[at] + a : a;
    out[at + s]     = add ? out[at + s] + b : b;
    out[at + 2 * s] = add ? out[at + 2 * s] + c : c;
  }
}

/* out [n] <- the matrix along every axis of in [n], every `to` and every `from` entries; what goes along the first two
   axes stays in registers */
INLINE void contract_all(const int dim, const Line which, const int from, const Lanes *in, const int to, Lanes *out)
{
  Lanes v[ELEMENT_MAX_NB];

  for (int j = 0; j < 9 && dim == 3; j++) {
    v[j]      = in[j * from];
    v[9 + j]  = in[(9 + j) * from];
    v[18 + j] = in[(18 + j) * from];
    turn(which, v + j, v + 9 + j, v + 18 + j);
  }
  for (int first = 0; first < NPOINT(dim); first += 9) {
    Lanes p[9];

    for (int j = 0; j < 9; j++) p[j] = dim == 3 ? v[first + j] : in[(first + j) * from];
    for (int j = 0; j < 3; j++) turn(which, p + j, p + 3 + j, p + 6 + j);
    for (int j = 0; j < 3; j++) turn(which, p + 3 * j, p + 3 * j + 1, p + 3 * j + 2);
    for (int j = 0; j < 9; j++) out[(first + j) * to] = p[j];
  }
}

/* ---- coefficients ---- */

/* inverse [e][a] = dxi_e/dx_a and det of J [a][e] */
INLINE Lanes invert(const int dim, Lanes J[3][3], Lanes inverse[3][3])
{
  Lanes det = {0};

  if (dim == 2) {
    det           = J[0][0] * J[1][1] - J[0][1] * J[1][0];
    inverse[0][0] = J[1][1] / det;
    inverse[0][1] = -J[0][1] / det;
    inverse[1][0] = -J[1][0] / det;
    inverse[1][1] = J[0][0] / det;
    return det;
  }
  for (int e = 0; e < 3; e++) {
    const int f = (e + 1) % 3, g = (e + 2) % 3;

    for (int a = 0; a < 3; a++) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;

      inverse[e][a] = J[b][f] * J[c][g] - J[b][g] * J[c][f];
    }
  }
  for (int a = 0; a < 3; a++) det += inverse[0][a] * J[a][0];
  for (int e = 0; e < 3; e++)
    for (int a = 0; a < 3; a++) inverse[e][a] /= det;
  return det;
}

/* Convection at point q: w [dim] there, slope [e][a] of it in reference coordinates; scale: weight and det */
INLINE void set_convection(const int dim, const BatchForm *f, Lanes scale, Lanes inverse[3][3], const Lanes w[3],
                           Lanes slope[3][3], Lanes *c)
{
  Lanes div = {0};

  for (int e = 0; e < dim; e++) {
    c[e] = inverse[e][0] * w[0];
    for (int a = 1; a < dim; a++) c[e] += inverse[e][a] * w[a];
    c[e] *= scale;
    for (int a = 0; a < dim && f->skew != 0; a++) div += inverse[e][a] * slope[e][a];
  }
  if (f->skew != 0) c[dim] = f->skew * scale * div;
}

typedef struct {
  Lanes value[3][ELEMENT_MAX_NB], slope[3][3][ELEMENT_MAX_NB]; /* [a], [e][a] */
} AtPoints;

INLINE void evaluate_all(const int dim, const PetscBool slopes, const Lanes *x, AtPoints *p)
{
  for (int a = 0; a < dim; a++) {
    contract_all(dim, VALUE, dim, x + a, 1, p->value[a]);
    for (int e = 0; e < dim && slopes; e++) contract(dim, e, PETSC_FALSE, SLOPE, p->value[a], p->slope[e][a]);
  }
}

INLINE void at_point(const int dim, const AtPoints *p, const int q, const PetscBool slopes, Lanes value[3],
                     Lanes slope[3][3])
{
  for (int a = 0; a < dim; a++) value[a] = p->value[a][q];
  for (int e = 0; e < dim && slopes; e++)
    for (int a = 0; a < dim; a++) slope[e][a] = p->slope[e][a][q];
}

INLINE void set_boxes(const int dim, const BatchTables *t, const BatchForm *f, Lanes det, const Lanes *inverse,
                      const Lanes *w, const Lanes *nu, Lanes *c)
{
  const int nflow     = f->convection ? dim + (f->skew != 0) : 0;
  Lanes     inv[3][3] = {{{0}}};
  AtPoints  p;

  c[0] = f->a * det;
  for (int e = 0; e < dim; e++) {
    inv[e][e] = inverse[e];
    c[1 + e]  = (f->vary ? 1 : f->b) * det * inverse[e] * inverse[e];
  }
  c += 1 + dim;
  for (int q = 0; q < NPOINT(dim) && f->vary; q++) c[q * (nflow + 1) + nflow] = f->b + nu[q];
  if (!f->convection) return;
  evaluate_all(dim, (PetscBool)(f->skew != 0), w, &p);
  for (int q = 0; q < NPOINT(dim); q++, c += nflow + (f->vary ? 1 : 0)) {
    Lanes value[3], slope[3][3] = {{{0}}};

    at_point(dim, &p, q, (PetscBool)(f->skew != 0), value, slope);
    set_convection(dim, f, t->weight[q] * det, inv, value, slope, c);
  }
}

INLINE void set_cells(const int dim, const BatchTables *t, const BatchForm *f, const Lanes *xc, const Lanes *w,
                      const Lanes *nu, Lanes *c)
{
  AtPoints position, p;

  evaluate_all(dim, PETSC_TRUE, xc, &position);
  if (f->convection) evaluate_all(dim, (PetscBool)(f->skew != 0), w, &p);
  for (int q = 0; q < NPOINT(dim); q++) {
    Lanes J[3][3], inverse[3][3], scale;

    for (int a = 0; a < dim; a++)
      for (int e = 0; e < dim; e++) J[a][e] = position.slope[e][a][q];
    scale = t->weight[q] * invert(dim, J, inverse);
    *c++  = f->a * scale;
    for (int e = 0; e < dim; e++)
      for (int g = e; g < dim; g++) {
        Lanes s = inverse[e][0] * inverse[g][0];

        for (int a = 1; a < dim; a++) s += inverse[e][a] * inverse[g][a];
        *c++ = f->vary ? (f->b + nu[q]) * scale * s : f->b * scale * s;
      }
    if (f->convection) {
      Lanes value[3], slope[3][3] = {{{0}}};

      at_point(dim, &p, q, (PetscBool)(f->skew != 0), value, slope);
      set_convection(dim, f, scale, inverse, value, slope, c);
      c += dim + (f->skew != 0);
    }
  }
}

void BatchSet(const BatchTables *t, const BatchForm *f, const BatchGeometry *g, const Lanes w[], const Lanes nu[],
              Lanes coefficient[])
{
  if (f->box && t->dim == 2) set_boxes(2, t, f, g->det, g->inverse, w, nu, coefficient);
  else if (f->box) set_boxes(3, t, f, g->det, g->inverse, w, nu, coefficient);
  else if (t->dim == 2) set_cells(2, t, f, g->xc, w, nu, coefficient);
  else set_cells(3, t, f, g->xc, w, nu, coefficient);
}

void BatchScaleMass(const BatchTables *t, const BatchForm *f, const Lanes *factor, Lanes coefficient[])
{
  const PetscInt n = f->box ? 1 : t->n, stride = BatchCoefficients(t, f) / n;

  for (PetscInt q = 0; q < n; q++) coefficient[q * stride] *= *factor;
}

/* ---- product ---- */

/* Values v [n] and slopes g [e][n] at the points <- what tests them, by component */
INLINE void apply_boxes(const int dim, const PetscBool convection, const PetscBool vary, const BatchTables *t,
                        const BatchForm *f, const Lanes *c, Lanes *v, Lanes g[3][ELEMENT_MAX_NB])
{
  const Lanes *flow = c + 1 + dim;
  const int    skew = convection && f->skew != 0;

  for (int q = 0; q < NPOINT(dim); q++) {
    Lanes r = t->weight[q] * c[0] * v[q];

    if (convection) {
      for (int e = 0; e < dim; e++) r += flow[e] * g[e][q];
      if (skew) r += flow[dim] * v[q];
      flow += dim + skew;
    }
    v[q] = r;
    for (int e = 0; e < dim; e++) g[e][q] *= t->weight[q] * c[1 + e];
    if (vary) {
      for (int e = 0; e < dim; e++) g[e][q] *= *flow;
      flow++;
    }
  }
}

INLINE void apply_cells(const int dim, const PetscBool convection, const BatchForm *f, const Lanes *c, Lanes *v,
                        Lanes g[3][ELEMENT_MAX_NB])
{
  const int skew = convection && f->skew != 0;

  for (int q = 0; q < NPOINT(dim); q++) {
    const Lanes *k = c + 1;
    Lanes        r = c[0] * v[q], flux[3] = {{0}};

    for (int e = 0; e < dim; e++)
      for (int h = e; h < dim; h++, k++) {
        flux[e] += *k * g[h][q];
        if (h > e) flux[h] += *k * g[e][q];
      }
    c += 1 + NTENSOR(dim);
    if (convection) {
      for (int e = 0; e < dim; e++) r += c[e] * g[e][q];
      if (skew) r += c[dim] * v[q];
      c += dim + skew;
    }
    v[q] = r;
    for (int e = 0; e < dim; e++) g[e][q] = flux[e];
  }
}

INLINE void multiply(const int dim, const PetscBool box, const PetscBool convection, const PetscBool vary,
                     const BatchTables *t, const BatchForm *f, const Lanes *c, Lanes *x)
{
  for (int a = 0; a < dim; a++) {
    Lanes v[ELEMENT_MAX_NB], g[3][ELEMENT_MAX_NB];

    contract_all(dim, VALUE, dim, x + a, 1, v);
    for (int e = 0; e < dim; e++) contract(dim, e, PETSC_FALSE, SLOPE, v, g[e]);
    if (box) apply_boxes(dim, convection, vary, t, f, c, v, g);
    else apply_cells(dim, convection, f, c, v, g);
    for (int e = 0; e < dim; e++) contract(dim, e, PETSC_TRUE, SLOPE_T, g[e], v);
    contract_all(dim, VALUE_T, 1, v, dim, x + a);
  }
}

/* The mass alone */
INLINE void apply_weights(const int dim, const BatchTables *t, const BatchForm *f, const Lanes *c, Lanes *x)
{
  for (int a = 0; a < dim; a++) {
    Lanes v[ELEMENT_MAX_NB];

    contract_all(dim, VALUE, dim, x + a, 1, v);
    for (int q = 0; q < NPOINT(dim); q++) v[q] *= f->box ? t->weight[q] * c[0] : c[q * (1 + NTENSOR(dim))];
    contract_all(dim, VALUE_T, 1, v, dim, x + a);
  }
}

void BatchMultiply(const BatchTables *t, const BatchForm *f, const Lanes c[], Lanes x[])
{
  const PetscBool moving = (PetscBool)(f->b != 0 || f->vary || f->convection);

  if (!moving && t->dim == 2) apply_weights(2, t, f, c, x);
  else if (!moving) apply_weights(3, t, f, c, x);
  else if (t->dim == 2) multiply(2, f->box, f->convection, f->vary, t, f, c, x);
  else if (f->box && f->vary) multiply(3, PETSC_TRUE, f->convection, PETSC_TRUE, t, f, c, x);
  else if (f->box && f->convection) multiply(3, PETSC_TRUE, PETSC_TRUE, PETSC_FALSE, t, f, c, x);
  else if (f->box) multiply(3, PETSC_TRUE, PETSC_FALSE, PETSC_FALSE, t, f, c, x);
  else if (f->convection) multiply(3, PETSC_FALSE, PETSC_TRUE, PETSC_FALSE, t, f, c, x);
  else multiply(3, PETSC_FALSE, PETSC_FALSE, PETSC_FALSE, t, f, c, x);
}

/* ---- diagonal ---- */

/* k [NTENSOR]: diffusion at point q; returns mass and divergence there; *flow: convection, or NULL */
INLINE Lanes read_point(const int dim, const BatchTables *t, const BatchForm *f, const Lanes *c, const int q, Lanes *k,
                        const Lanes **flow)
{
  const int nflow = f->convection ? dim + (f->skew != 0) : 0;
  Lanes     mass;

  if (f->box) {
    mass  = t->weight[q] * c[0];
    *flow = c + 1 + dim + q * (nflow + (f->vary ? 1 : 0));
    for (int e = 0, at = 0; e < dim; e++)
      for (int h = e; h < dim; h++, at++)
        k[at] = e != h ? (Lanes){0} : f->vary ? t->weight[q] * c[1 + e] * (*flow)[nflow] : t->weight[q] * c[1 + e];
  } else {
    c += q * (1 + NTENSOR(dim) + nflow);
    mass = c[0];
    for (int at = 0; at < NTENSOR(dim); at++) k[at] = c[1 + at];
    *flow = c + 1 + NTENSOR(dim);
  }
  if (!f->convection) *flow = NULL;
  else if (f->skew != 0) mass += (*flow)[dim];
  return mass;
}

/* x <- M along an axis */
INLINE void contract_pair(const int dim, const int axis, const PetscReal M[3][3], Lanes *x)
{
  const int s = axis == 0 ? 1 : axis == 1 ? 3 : 9;

  for (int line = 0; line < NPOINT(dim) / 3; line++) {
    Lanes      *at = x + line / s * 3 * s + line % s;
    const Lanes a = at[0], b = at[s], c = at[2 * s];

    for (int q = 0; q < 3; q++) at[q * s] = M[q][0] * a + M[q][1] * b + M[q][2] * c;
  }
}

/* d += sum over the points of x times the product over the axes of t->pair[order]; x is lost */
INLINE void add_pairs(const int dim, const BatchTables *t, const int order[3], Lanes *x, Lanes *d)
{
  for (int e = 0; e < dim; e++) contract_pair(dim, e, t->pair[order[e]], x);
  for (int j = 0; j < NPOINT(dim); j++) d[j] += x[j];
}

INLINE void diagonal(const int dim, const BatchTables *t, const BatchForm *f, const Lanes *c, Lanes *d)
{
  Lanes mass[ELEMENT_MAX_NB], convection[3][ELEMENT_MAX_NB], diffusion[6][ELEMENT_MAX_NB];

  for (int q = 0; q < NPOINT(dim); q++) {
    const Lanes *flow;
    Lanes        k[6];

    d[q]    = (Lanes){0};
    mass[q] = read_point(dim, t, f, c, q, k, &flow);
    for (int e = 0; e < dim && flow; e++) convection[e][q] = flow[e];
    for (int at = 0; at < NTENSOR(dim); at++) diffusion[at][q] = k[at];
  }
  add_pairs(dim, t, (const int[]){0, 0, 0}, mass, d);
  for (int e = 0; e < dim && f->convection; e++)
    add_pairs(dim, t, (const int[]){e == 0, e == 1, e == 2}, convection[e], d);
  for (int e = 0, at = 0; e < dim; e++)
    for (int h = e; h < dim; h++, at++) {
      if (e != h && f->box) continue;
      for (int q = 0; q < NPOINT(dim) && e != h; q++) diffusion[at][q] *= 2;
      add_pairs(dim, t, (const int[]){(e == 0) + (h == 0), (e == 1) + (h == 1), (e == 2) + (h == 2)}, diffusion[at], d);
    }
}

void BatchDiagonal(const BatchTables *t, const BatchForm *f, const Lanes c[], Lanes d[])
{
  if (t->dim == 2) diagonal(2, t, f, c, d);
  else diagonal(3, t, f, c, d);
}

/* ---- integrals ---- */

/* At the points of cells that are no boxes */
INLINE void integrate_cells(const int dim, const BatchTables *t, const BatchGeometry *g, PetscReal skew, const Lanes *u,
                            const Lanes *v, const Lanes *w, BatchIntegrals *out)
{
  const BatchForm form = {.skew = skew};
  AtPoints        position, at_u, at_v, at_w;
  const AtPoints *pv = v ? &at_v : &at_u;

  evaluate_all(dim, PETSC_TRUE, u, &at_u);
  if (v) evaluate_all(dim, PETSC_TRUE, v, &at_v);
  if (w) evaluate_all(dim, (PetscBool)(skew != 0), w, &at_w);
  evaluate_all(dim, PETSC_TRUE, g->xc, &position);
  for (int q = 0; q < NPOINT(dim); q++) {
    Lanes inverse[3][3], J[3][3], value[3], slope[3][3] = {{{0}}}, flow[4], scale;

    for (int a = 0; a < dim; a++)
      for (int e = 0; e < dim; e++) J[a][e] = position.slope[e][a][q];
    scale = t->weight[q] * invert(dim, J, inverse);
    for (int a = 0; a < dim; a++) {
      out->square += scale * at_u.value[a][q] * at_u.value[a][q];
      for (int e = 0; e < dim; e++) out->divergence += scale * inverse[e][a] * at_u.slope[e][a][q];
    }
    if (!w) continue;
    at_point(dim, &at_w, q, (PetscBool)(skew != 0), value, slope);
    set_convection(dim, &form, scale, inverse, value, slope, flow);
    for (int a = 0; a < dim; a++) {
      for (int e = 0; e < dim; e++) out->flux[a] += flow[e] * pv->slope[e][a][q];
      if (skew != 0) out->flux[a] += flow[dim] * pv->value[a][q];
    }
  }
}

/* test [n] += what (m d/dx, .) + skew (dm/dx, .) along an axis has of each polynomial, but for its norm: the derivative
   of the first polynomial is the constant, that of the second three times the first */
INLINE void add_slopes(const int dim, const int axis, const PetscReal skew, const Lanes inverse, const Lanes *m,
                       Lanes *test)
{
  const int   s     = axis == 0 ? 1 : axis == 1 ? 3 : 9;
  const Lanes steep = 7.5 * inverse, first = 3 * skew * inverse, second = 2 * skew * inverse;

  for (int line = 0; line < NPOINT(dim) / 3; line++) {
    const int at = line / s * 3 * s + line % s;

    test[at + s] += inverse * m[at];
    test[at + 2 * s] += steep * m[at + s];
    if (skew == 0) continue;
    test[at] += first * m[at + s];
    test[at + s] += second * m[at + 2 * s];
  }
}

/* Of boxes, exactly, where Legendre polynomials are orthogonal */
INLINE void integrate_boxes(const int dim, const BatchTables *t, const BatchGeometry *g, PetscReal skew, const Lanes *u,
                            const Lanes *v, const Lanes *w, BatchIntegrals *out)
{
  Lanes m[3][ELEMENT_MAX_NB], mw[ELEMENT_MAX_NB], test[ELEMENT_MAX_NB] = {{0}};

  for (int a = 0; a < dim; a++) contract_all(dim, EXPAND, dim, u + a, 1, m[a]);
  for (int q = 0; q < NPOINT(dim); q++) {
    Lanes square = m[0][q] * m[0][q];

    for (int a = 1; a < dim; a++) square += m[a][q] * m[a][q];
    out->square += t->norm[q] * square;
  }
  out->square *= g->det;
  for (int a = 0; a < dim; a++) out->divergence += g->inverse[a] * m[a][a == 0 ? 1 : a == 1 ? 3 : 9];
  out->divergence *= (dim == 2 ? 1. / 3 : 1. / 9) * g->det;
  if (!w) return;
  for (int a = 0; a < dim && v; a++) contract_all(dim, EXPAND, dim, v + a, 1, m[a]);
  for (int e = 0; e < dim; e++) {
    contract_all(dim, EXPAND, dim, w + e, 1, mw);
    add_slopes(dim, e, skew, g->inverse[e], mw, test);
  }
  for (int q = 0; q < NPOINT(dim); q++) {
    test[q] *= t->norm[q];
    for (int a = 0; a < dim; a++) out->flux[a] += test[q] * m[a][q];
  }
  for (int a = 0; a < dim; a++) out->flux[a] *= g->det;
}

void BatchIntegrate(const BatchTables *t, PetscBool box, const BatchGeometry *g, PetscReal skew, const Lanes u[],
                    const Lanes v[], const Lanes w[], BatchIntegrals *out)
{
  *out = (BatchIntegrals){0};
  if (t->dim == 2 && box) integrate_boxes(2, t, g, skew, u, v, w, out);
  else if (t->dim == 2) integrate_cells(2, t, g, skew, u, v, w, out);
  else if (box) integrate_boxes(3, t, g, skew, u, v, w, out);
  else integrate_cells(3, t, g, skew, u, v, w, out);
}
