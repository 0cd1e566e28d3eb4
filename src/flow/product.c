/* Flow: products with the velocity operator without a matrix (flow.h), in batches of own cells of one kind. Ghost nodes
   get their values before and give their sums after. */
#include "compat.h"
#include "impl.h"
#include "lanes.h"

typedef struct {
  LaneCells cells;
  size_t    at; /* where its coefficients begin */
} Batch;

struct _p_Product {
  BatchForm  form;
  PetscInt   n, batch_capacity;
  Batch     *batch;
  size_t     used, capacity; /* coefficients */
  Lanes     *coefficient;
  void      *memory; /* which they lie in, at an address that vectors want */
  PetscReal *x, *y;  /* [nnode_all][dim] with ghosts, on more than one rank */
};

/* Batches of the fluid's own cells, and where their coefficients lie */
static PetscErrorCode group_cells(Flow f, struct _p_Product *p)
{
  PetscInt  n    = LanesMax(f->loc);
  LaneWalk  walk = {0};
  LaneCells next;

  PetscFunctionBeginUser;
  if (p->batch_capacity < n) {
    PetscCall(PetscFree(p->batch));
    PetscCall(PetscMalloc1(n, &p->batch));
    p->batch_capacity = n;
  }
  p->n    = 0;
  p->used = 0;
  while (LanesNext(f, &walk, &next)) {
    p->batch[p->n++] = (Batch){next, p->used};
    p->form.box      = next.box;
    p->used += (size_t)BatchCoefficients(f->tables, &p->form);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reserve_coefficients(struct _p_Product *p)
{
  PetscFunctionBeginUser;
  if (p->used <= p->capacity) PetscFunctionReturn(PETSC_SUCCESS);
  p->capacity = p->used;
  PetscCall(PetscFree(p->memory));
  PetscCall(PetscMalloc((p->capacity + 1) * sizeof(Lanes), &p->memory));
  p->coefficient = (Lanes *)(((size_t)p->memory + sizeof(Lanes) - 1) / sizeof(Lanes) * sizeof(Lanes));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the material adds to the viscosity at the points of cell c; the element's run along the last axis first */
static void gather_viscosity(const struct _p_Flow *f, PetscInt c, PetscInt k, Lanes nu[])
{
  const PetscInt   nq = f->element.nq;
  const PetscReal *mu = f->viscosity.mu + c * nq;

  for (PetscInt q = 0; q < nq; q++) {
    const PetscInt there = nq == 9 ? q % 3 * 3 + q / 3 : q % 3 * 9 + q / 3 % 3 * 3 + q / 9;

    *Lane(&nu[q], k) = f->material->factor * f->step.theta * mu[there];
  }
}

static PetscErrorCode set_batch(Flow f, struct _p_Product *p, const Batch *b)
{
  const PetscReal scale = f->par.density * f->step.theta;
  BatchGeometry   g;
  Lanes           w[MESH_MAX_NB * 3], nu[MESH_MAX_NB], ratio = {1, 1, 1, 1, 1, 1, 1, 1};

  PetscFunctionBeginUser;
  p->form.box = b->cells.box;
  if (p->form.convection) {
    LanesGather(f->loc, &b->cells, 1, (const PetscReal *[]){f->w}, &scale, w);
    FlowScaleByDensity(f, &b->cells, f->loc->nb * f->loc->dim, w);
  }
  for (PetscInt k = 0; k < BATCH_LANES && p->form.vary; k++)
    gather_viscosity(f, b->cells.cell[k < b->cells.n ? k : 0], k, nu);
  PetscCall(LanesGeometry(f, &b->cells, &g));
  BatchSet(f->tables, &p->form, &g, w, nu, p->coefficient + b->at);
  if (f->properties.density) {
    FlowScaleByDensity(f, &b->cells, 1, &ratio);
    BatchScaleMass(f->tables, &p->form, &ratio, p->coefficient + b->at);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowUpdateProduct(Flow f)
{
  struct _p_Product *p = f->matrix.product;

  PetscFunctionBeginUser;
  p->form = (BatchForm){.a          = f->par.density * f->step.ct,
                        .b          = f->par.viscosity * f->step.theta,
                        .skew       = f->par.skew,
                        .convection = f->par.convection,
                        .vary       = (PetscBool)(f->viscosity.mu != NULL)};
  if (f->device) {
    PetscCall(OnDeviceUpdate(f));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(group_cells(f, p));
  PetscCall(reserve_coefficients(p));
  for (PetscInt i = 0; i < p->n; i++) PetscCall(set_batch(f, p, &p->batch[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same for one term in space: four columns at a time */
static void add_term_space(const PetscInt node[], const PetscReal term[], const PetscReal x[], PetscReal y[])
{
  typedef PetscReal Four __attribute__((vector_size(4 * sizeof(PetscReal)), aligned(sizeof(PetscReal))));
  PetscReal         xl[3][28] = {{0}}, row[28] = {0};

  for (int j = 0; j < 27; j++)
    for (int a = 0; a < 3; a++) xl[a][j] = x[node[j] * 3 + a];
  for (int i = 0; i < 27; i++) {
    Four sum[3] = {{0}, {0}, {0}};

    for (int j = 0; j < 27; j++) row[j] = term[i * 27 + j];
    for (int j = 0; j < 28; j += 4)
      for (int a = 0; a < 3; a++) sum[a] += *(const Four *)(row + j) * *(const Four *)(xl[a] + j);
    for (int a = 0; a < 3; a++) y[node[i] * 3 + a] += sum[a][0] + sum[a][1] + sum[a][2] + sum[a][3];
  }
}

/* y += the terms of own cells times x */
static void add_terms(const struct _p_Flow *f, const CellTerms *terms, const PetscReal x[], PetscReal y[])
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, nb = l->nb;

  for (PetscInt t = 0; t < terms->n; t++) {
    const PetscInt  *node = l->cell_node + terms->cell[t] * nb;
    const PetscReal *term = terms->matrix + t * nb * nb;

    if (terms->cell[t] >= l->ncell) continue;
    if (dim == 3) {
      add_term_space(node, term, x, y);
      continue;
    }
    for (PetscInt i = 0; i < nb; i++) {
      PetscReal s[3] = {0, 0, 0};

      for (PetscInt j = 0; j < nb; j++)
        for (PetscInt a = 0; a < dim; a++) s[a] += term[i * nb + j] * x[node[j] * dim + a];
      for (PetscInt a = 0; a < dim; a++) y[node[i] * dim + a] += s[a];
    }
  }
}

/* d += their diagonal */
static void add_terms_diagonal(const struct _p_Flow *f, const CellTerms *terms, PetscReal d[])
{
  const PetscInt nb = f->loc->nb;

  for (PetscInt t = 0; t < terms->n; t++)
    for (PetscInt j = 0; j < nb && terms->cell[t] < f->loc->ncell; j++)
      d[f->loc->cell_node[terms->cell[t] * nb + j]] += terms->matrix[(t * nb + j) * nb + j];
}

static PetscBool all_zero(PetscInt n, const Lanes x[])
{
  const PetscReal *v = (const PetscReal *)x;

  for (PetscInt i = 0; i < n * BATCH_LANES; i++)
    if (v[i] != 0) return PETSC_FALSE;
  return PETSC_TRUE;
}

PetscErrorCode FlowMultiply(Flow f, PetscBool few, const PetscReal x[], PetscReal y[])
{
  struct _p_Product *p = f->matrix.product;
  const MeshLocal   *l = f->loc;
  const PetscInt     n = l->nnode * l->dim, n_all = l->nnode_all * l->dim;
  const PetscBool    alone = (PetscBool)(l->nnode == l->nnode_all);
  const PetscReal   *from  = alone ? x : p->x;
  PetscReal         *to    = alone ? y : p->y;
  const PetscReal    one   = 1;
  BatchForm          form  = p->form;

  PetscFunctionBeginUser;
  if (f->device) {
    PetscCall(OnDeviceMultiply(f, x, y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (!alone) PetscCall(PetscArraycpy(p->x, x, n));
  PetscCall(MeshFetchNodes(f->mesh, l->dim, x, p->x));
  PetscCall(PetscArrayzero(to, n_all));
  for (PetscInt i = 0; i < p->n; i++) {
    const Batch *b = &p->batch[i];
    Lanes        v[MESH_MAX_NB * 3];

    form.box = b->cells.box;
    LanesGather(l, &b->cells, 1, &from, &one, v);
    if (few && all_zero(l->nb * l->dim, v)) continue;
    BatchMultiply(f->tables, &form, p->coefficient + b->at, v);
    LanesScatter(l, &b->cells, l->dim, v, to);
  }
  for (PetscInt o = 0; o < f->owners.nterms; o++) add_terms(f, &f->owners.terms[o], from, to);
  PetscCall(MeshSumNodes(f->mesh, l->dim, to));
  if (!alone) PetscCall(PetscArraycpy(y, p->y, n));
  PetscCall(PetscLogFlops((PetscLogDouble)l->ncell * l->dim * l->nb * (24 * l->dim + 8)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* d += diagonal of a batch; of cells where something hangs that of H^T K H */
static PetscErrorCode add_diagonal(Flow f, const struct _p_Product *p, const Batch *b, PetscReal d[])
{
  const MeshLocal *l    = f->loc;
  BatchForm        form = p->form;
  Lanes            v[MESH_MAX_NB];

  PetscFunctionBeginUser;
  form.box = b->cells.box;
  BatchDiagonal(f->tables, &form, p->coefficient + b->at, v);
  for (PetscInt k = 0; k < b->cells.n; k++) {
    const PetscInt  c = b->cells.cell[k], *node = l->cell_node + c * l->nb;
    PetscReal       ce[MESH_MAX_NB * ELEMENT_MAX_NBP], hanging[MESH_MAX_NB];
    const MeshHang *h = MeshCellHang(l, c);

    if (h) {
      PetscCall(FlowCellLatticeMatrix(f, c, ce));
      MeshHangDiagonal(h, f->element.nbp, ce, hanging);
    }
    for (PetscInt j = 0; j < l->nb; j++) d[node[j]] += h ? hanging[j] : Lane(v, k)[j * BATCH_LANES];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetDiagonal(Flow f, PetscReal d[])
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(d, l->nnode_all));
  if (f->device) PetscCall(OnDeviceGetDiagonal(f, d));
  else if (f->matrix.product) {
    for (PetscInt i = 0; i < f->matrix.product->n; i++)
      PetscCall(add_diagonal(f, f->matrix.product, &f->matrix.product->batch[i], d));
    for (PetscInt o = 0; o < f->owners.nterms; o++) add_terms_diagonal(f, &f->owners.terms[o], d);
    PetscCall(MeshSumNodes(f->mesh, 1, d));
  } else {
    Vec diagonal;

    PetscCall(VecCreateMPIWithArray(f->comm, 1, l->nnode, PETSC_DETERMINE, d, &diagonal));
    PetscCall(MatGetDiagonal(f->matrix.S, diagonal));
    PetscCall(VecDestroy(&diagonal));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCreateProduct(Flow f)
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f->matrix.product));
  if (l->nnode < l->nnode_all)
    PetscCall(PetscMalloc2(l->nnode_all * l->dim, &f->matrix.product->x, l->nnode_all * l->dim, &f->matrix.product->y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDestroyProduct(Flow f)
{
  struct _p_Product *p = f->matrix.product;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree(p->batch));
  PetscCall(PetscFree(p->memory));
  PetscCall(PetscFree2(p->x, p->y));
  PetscCall(PetscFree(f->matrix.product));
  PetscFunctionReturn(PETSC_SUCCESS);
}
