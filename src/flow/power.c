/* Flow: the momentum equation of a step tested with a velocity, term by term (flow.h). */
#include "compat.h"
#include "impl.h"
#include "lanes.h"

/* sum over the cells in the lanes of x . y [nb][dim] */
static PetscReal product_of(const LaneCells *b, PetscInt n, Lanes x[], Lanes y[])
{
  PetscReal sum = 0;

  for (PetscInt i = 0; i < n; i++)
    for (PetscInt k = 0; k < b->n; k++) sum += *Lane(&x[i], k) * *Lane(&y[i], k);
  return sum;
}

/* x . the form times y; y is lost */
static PetscReal power_of(Flow f, const LaneCells *b, const BatchGeometry *g, const BatchForm *form, const Lanes w[],
                          Lanes x[], Lanes y[])
{
  Lanes coefficient[1 + 3 + MESH_MAX_NB * (1 + 6 + 4)];

  BatchSet(f->tables, form, g, w, NULL, coefficient);
  BatchMultiply(f->tables, form, coefficient, y);
  return product_of(b, f->loc->nb * f->loc->dim, x, y);
}

static PetscErrorCode add_power(Flow f, const LaneCells *b, const PetscReal u[], const PetscReal test[], FlowPower *p)
{
  const MeshLocal *l   = f->loc;
  const FlowStep  *s   = &f->step;
  const PetscReal  one = 1, between[] = {s->theta, 1 - s->theta}, change[] = {s->ct, -s->d0, -s->d1};
  const BatchForm  mass = {.box = b->box, .a = f->par.density}, viscous = {.box = b->box, .b = f->par.viscosity};
  const BatchForm  convection = {.box = b->box, .convection = PETSC_TRUE, .skew = f->par.skew};
  Lanes            v[MESH_MAX_NB * 3], x[MESH_MAX_NB * 3], w[MESH_MAX_NB * 3];
  BatchGeometry    g;

  PetscFunctionBeginUser;
  PetscCall(LanesGeometry(f, b, &g));
  LanesGather(l, b, 1, &test, &one, v);
  LanesGather(l, b, 3, (const PetscReal *[]){u, f->u, f->u_old}, change, x);
  FlowScaleByDensity(f, b, l->nb * l->dim, x);
  p->inertia += power_of(f, b, &g, &mass, NULL, v, x);
  LanesGather(l, b, 2, (const PetscReal *[]){u, f->u}, between, x);
  p->viscous += power_of(f, b, &g, &viscous, NULL, v, x);
  if (!f->par.convection) PetscFunctionReturn(PETSC_SUCCESS);
  LanesGather(l, b, 1, (const PetscReal *[]){f->w}, &f->par.density, w);
  LanesGather(l, b, 2, (const PetscReal *[]){u, f->u}, between, x);
  FlowScaleByDensity(f, b, l->nb * l->dim, x);
  p->inertia += power_of(f, b, &g, &convection, w, v, x);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* v . the terms of own cells times u */
static PetscReal power_of_terms(const struct _p_Flow *f, const CellTerms *terms, const PetscReal u[],
                                const PetscReal v[])
{
  const PetscInt dim = f->loc->dim, nb = f->loc->nb;
  PetscReal      sum = 0;

  for (PetscInt t = 0; t < terms->n; t++) {
    const PetscInt  *node = f->loc->cell_node + terms->cell[t] * nb;
    const PetscReal *term = terms->matrix + t * nb * nb;

    if (terms->cell[t] >= f->loc->ncell) continue;
    for (PetscInt e = 0; e < nb * nb; e++)
      for (PetscInt a = 0; a < dim; a++) sum += v[node[e / nb] * dim + a] * term[e] * u[node[e % nb] * dim + a];
  }
  return sum;
}

PetscErrorCode FlowGetPower(Flow f, const PetscReal u[], const PetscReal v[], FlowPower *p)
{
  LaneWalk  walk = {0};
  LaneCells next;
  PetscReal sum[3];

  PetscFunctionBeginUser;
  *p = (FlowPower){0};
  PetscCall(FlowBringFields(f));
  while (LanesNext(f, &walk, &next)) PetscCall(add_power(f, &next, u, v, p));
  sum[0] = p->inertia;
  sum[1] = p->viscous;
  sum[2] = 0;
  for (PetscInt o = 0; o < f->owners.nterms; o++) sum[2] += power_of_terms(f, &f->owners.terms[o], u, v);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, f->comm));
  *p = (FlowPower){.inertia = sum[0], .viscous = sum[1], .terms = sum[2]};
  PetscFunctionReturn(PETSC_SUCCESS);
}
