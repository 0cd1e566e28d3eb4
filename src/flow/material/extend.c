/* Flow, cells that bodies cover in part (flow.h, FlowSetCutCells): their velocity is a compromise between the fluid and
   a body, so that neither its gradient nor what a polymer makes of it is that of the fluid. Nodal fields of the fluid
   are continued into them: at nodes of a bare cell they and their gradients come from bare cells alone, at nodes that
   no bare cell has from the nodes of their cells that have values by Taylor's formula, a layer of nodes at a time. The
   values next to the body are so continued linearly, with an error of second order in the size of the cells. */
#include "compat.h"
#include "generalised.h"

#define LAYERS 3   /* of nodes: a cut cell lies within one cell of the fluid, mostly */
#define FAR    1.0 /* largest change from node to node (logarithm): a factor e */
/* Of a change of the viscosity that is asked for, when it settles */
#define MIN_RELAXATION 0.1
#define MAX_RELAXATION 1.5

struct _p_Extension {
  PetscBool       *cut;          /* [ncell_all] */
  PetscInt         ncell, *cell; /* cut cells, own and ghost */
  PetscInt         nnode, *node; /* own nodes of them */
  PetscInt        *layer;        /* [nnode_all] 1: of a bare cell, 2 and on: from the layers before; 0: no value */
  FlowCutViscosity mode;
  PetscReal       *mu, *rate; /* [ncell][nq] of the cut cells: viscosity, rate of strain */
  PetscReal       *last,
    relaxation;      /* [ncell][nq] change of the logarithm that was asked for last; factor of what was taken */
  PetscReal  change; /* of the last evaluation, see FlowSetCutViscosity */
  PetscReal *taylor; /* [nnode_all][bs][dim + 1] value and gradient of every component */
};

static PetscBool is_bare(const struct _p_Flow *f, PetscInt c)
{
  return (PetscBool)(!FlowGeneralised(f)->extension->cut[c] && f->cells.det[c] != 0);
}

/* ---- which cells, which nodes ---- */

static PetscErrorCode allocate(Flow f, Extension *extension)
{
  const MeshLocal *l = f->loc;
  const PetscInt   n = l->ncell_all * f->element.nq;
  Extension        e;

  PetscFunctionBeginUser;
  if (*extension) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&e));
  PetscCall(PetscCalloc2(l->ncell_all, &e->cut, l->ncell_all, &e->cell));
  PetscCall(PetscCalloc2(l->nnode, &e->node, l->nnode_all, &e->layer));
  PetscCall(PetscCalloc1(l->nnode_all * (l->dim + 1), &e->taylor));
  PetscCall(PetscCalloc3(n, &e->mu, n, &e->rate, n, &e->last));
  *extension = e;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExtensionDestroy(Extension *extension)
{
  Extension e = *extension;

  PetscFunctionBeginUser;
  if (!e) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2(e->cut, e->cell));
  PetscCall(PetscFree2(e->node, e->layer));
  PetscCall(PetscFree(e->taylor));
  PetscCall(PetscFree3(e->mu, e->rate, e->last));
  PetscCall(PetscFree(*extension));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own nodes of cut cells */
static void list_nodes(Flow f)
{
  const MeshLocal *l = f->loc;
  Extension        e = FlowGeneralised(f)->extension;

  e->nnode = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscBool any = PETSC_FALSE, bare = PETSC_FALSE;

    for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++) {
      any  = (PetscBool)(any || e->cut[l->node_cell[t]]);
      bare = (PetscBool)(bare || is_bare(f, l->node_cell[t]));
    }
    e->layer[i] = any && bare;
    if (any) e->node[e->nnode++] = i;
  }
}

/* Has a node of the cells of node i a layer before `layer`? */
static PetscBool has_earlier(const struct _p_Flow *f, PetscInt i, PetscInt layer)
{
  const MeshLocal *l = f->loc;

  for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++)
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt other = FlowGeneralised(f)->extension->layer[l->cell_node[l->node_cell[t] * l->nb + j]];

      if (other > 0 && other < layer) return PETSC_TRUE;
    }
  return PETSC_FALSE;
}

PetscErrorCode FlowSetCutCells(Flow f, PetscInt n, const PetscInt cell[])
{
  const MeshLocal *l = f->loc;
  Extension        e;

  PetscFunctionBeginUser;
  if (!FlowGeneralised(f)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(allocate(f, &FlowGeneralised(f)->extension));
  e = FlowGeneralised(f)->extension;
  for (PetscInt c = 0; c < e->ncell; c++) e->cut[e->cell[c]] = PETSC_FALSE;
  e->ncell = 0;
  for (PetscInt c = 0; c < n; c++) {
    if (e->cut[cell[c]]) continue;
    e->cut[cell[c]]     = PETSC_TRUE;
    e->cell[e->ncell++] = cell[c];
  }
  e->mode = CUT_UPDATE;
  PetscCall(PetscArrayzero(e->mu, l->ncell_all * f->element.nq));
  list_nodes(f);
  PetscCall(MeshSyncNodesInt(f->mesh, e->layer));
  for (PetscInt layer = 2; layer < 2 + LAYERS; layer++) {
    for (PetscInt k = 0; k < e->nnode; k++)
      if (!e->layer[e->node[k]] && has_earlier(f, e->node[k], layer)) e->layer[e->node[k]] = layer;
    PetscCall(MeshSyncNodesInt(f->mesh, e->layer));
  }
  f->viscosity.current = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- values ---- */

/* Taylor's formula at own node i from the nodes of the layers before it, the nearer the more */
static PetscErrorCode continue_node(Flow f, PetscInt i, PetscInt bs, PetscReal far)
{
  const MeshLocal *l   = f->loc;
  const PetscInt   dim = l->dim, width = bs * (dim + 1);
  Extension        e  = FlowGeneralised(f)->extension;
  PetscReal       *to = e->taylor + i * width, sum = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(to, width));
  for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++) {
    const PetscInt   c = l->node_cell[t], *node = l->cell_node + c * l->nb;
    PetscReal        xs[MESH_MAX_NB * 3];
    const PetscReal *x = NULL;

    PetscCall(MeshSlotCoordinates(f->mesh, c, xs));
    for (PetscInt j = 0; j < l->nb; j++)
      if (node[j] == i) x = xs + j * dim;
    for (PetscInt j = 0; j < l->nb && x; j++) {
      const PetscReal *from = e->taylor + node[j] * width;
      PetscReal        d[3], square = 0;

      if (!e->layer[node[j]] || e->layer[node[j]] >= e->layer[i]) continue;
      for (PetscInt a = 0; a < dim; a++) {
        d[a] = x[a] - xs[j * dim + a];
        square += d[a] * d[a];
      }
      sum += 1 / square;
      for (PetscInt k = 0; k < bs; k++) {
        const PetscReal *g    = from + k * (dim + 1);
        PetscReal        step = 0;

        for (PetscInt a = 0; a < dim; a++) step += g[1 + a] * d[a];
        to[k * (dim + 1)] += (g[0] + PetscMax(-far, PetscMin(far, step))) / square;
        for (PetscInt a = 0; a < dim; a++) to[k * (dim + 1) + 1 + a] += g[1 + a] / square;
      }
    }
  }
  for (PetscInt k = 0; k < width; k++) to[k] /= sum;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the first layer, which the caller has filled in at own nodes, to all others. Collective. */
static PetscErrorCode continue_field(Flow f, PetscInt bs, PetscReal far)
{
  const Extension e = FlowGeneralised(f)->extension;

  PetscFunctionBeginUser;
  for (PetscInt layer = 1; layer < 2 + LAYERS; layer++) {
    for (PetscInt k = 0; k < e->nnode && layer > 1; k++)
      if (e->layer[e->node[k]] == layer) PetscCall(continue_node(f, e->node[k], bs, far));
    PetscCall(MeshSyncNodes(f->mesh, bs * (f->loc->dim + 1), e->taylor));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- viscosity ---- */

/* The logarithm of mu in bare cell c as a linear function: value at the centre and gradient, line [dim + 1] */
static PetscErrorCode fit_cell(Flow f, PetscInt c, PetscReal line[])
{
  const PetscInt   dim = f->loc->dim, nb = f->loc->nb, nq = f->element.nq;
  PetscReal        slope[3] = {0, 0, 0}, square[3] = {0, 0, 0};
  const PetscReal *inverse;
  ElementMetric    m;

  PetscFunctionBeginUser;
  PetscCall(FlowCellMetric(f, c, &m));
  inverse = ElementInverse(&m, nq / 2);
  for (PetscInt a = 0; a <= dim; a++) line[a] = 0;
  for (PetscInt q = 0; q < nq; q++) {
    const PetscReal value = PetscLogReal(f->viscosity.mu[c * nq + q]);

    line[0] += value / nq;
    for (PetscInt e = 0, stride = 1; e < dim; e++, stride *= 3) {
      PetscReal xi = 0;

      for (PetscInt j = 0; j < nb; j++) xi += (j / stride % 3 - 1) * f->element.phi[q * f->element.nbp + j];
      slope[e] += xi * value;
      square[e] += xi * xi;
    }
  }
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt e = 0; e < dim; e++) line[1 + a] += slope[e] / square[e] * inverse[e * dim + a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* First layer: means over the bare cells of own node i */
static PetscErrorCode start_viscosity(Flow f, PetscInt i)
{
  const MeshLocal *l     = f->loc;
  const PetscInt   dim   = l->dim;
  PetscReal       *to    = FlowGeneralised(f)->extension->taylor + i * (dim + 1);
  PetscInt         count = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(to, dim + 1));
  for (PetscInt t = l->node_cell_ptr[i]; t < l->node_cell_ptr[i + 1]; t++) {
    const PetscInt c = l->node_cell[t];
    PetscReal      xs[MESH_MAX_NB * 3], line[4];

    if (!is_bare(f, c)) continue;
    PetscCall(MeshSlotCoordinates(f->mesh, c, xs));
    PetscCall(fit_cell(f, c, line));
    for (PetscInt j = 0; j < l->nb; j++)
      for (PetscInt a = 0; a < dim && l->cell_node[c * l->nb + j] == i; a++)
        to[0] += line[1 + a] * (xs[j * dim + a] - xs[l->nb / 2 * dim + a]);
    for (PetscInt a = 0; a <= dim; a++) to[a] += line[a];
    count++;
  }
  for (PetscInt a = 0; a <= dim; a++) to[a] /= count;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* mu of cut cell number k, or as it is where a node has no value */
static void interpolate_viscosity(const struct _p_Flow *f, PetscInt k, PetscReal mu[])
{
  const MeshLocal *l   = f->loc;
  const Extension  e   = FlowGeneralised(f)->extension;
  const PetscInt   dim = l->dim, nb = l->nb, *node = l->cell_node + e->cell[k] * nb;
  PetscReal        v[MESH_MAX_NB];

  for (PetscInt j = 0; j < nb; j++) {
    if (!e->layer[node[j]]) return; /* deep inside, where nothing moves */
    v[j] = e->taylor[node[j] * (dim + 1)];
  }
  MeshCellGather(l, e->cell[k], 1, v);
  for (PetscInt q = 0; q < f->element.nq; q++) {
    PetscReal value = 0;

    for (PetscInt j = 0; j < nb; j++) value += f->element.phi[q * f->element.nbp + j] * v[j];
    mu[q] = PetscExpReal(value);
  }
}

PetscErrorCode FlowSetCutViscosity(Flow f, FlowCutViscosity mode, PetscReal *change)
{
  Extension e = FlowGeneralised(f) ? FlowGeneralised(f)->extension : NULL;

  PetscFunctionBeginUser;
  if (change) *change = 0;
  if (!e) PetscFunctionReturn(PETSC_SUCCESS);
  if (mode == CUT_UPDATE) e->relaxation = 0; /* settles anew */
  if (mode == CUT_UPDATE) e->change = PETSC_MAX_REAL;
  if (change) *change = e->change;
  e->mode              = mode;
  f->viscosity.current = (PetscBool)(f->viscosity.current && mode == CUT_FROZEN);
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ExtensionKeepRates(Flow f)
{
  const PetscInt  nq = f->element.nq;
  const Extension e  = FlowGeneralised(f)->extension;

  for (PetscInt i = 0; e && i < e->ncell * nq; i++) e->rate[i] = f->viscosity.mu[e->cell[i / nq] * nq + i % nq];
}

/* What the viscosities mu [nq] of cut cell number k, in place of those that are kept, make of the stress; *stress_max:
   the largest stress so far */
static PetscReal get_change(const struct _p_Flow *f, PetscInt k, const PetscReal mu[], PetscReal *stress_max)
{
  const Extension e      = FlowGeneralised(f)->extension;
  PetscReal       change = 0;

  for (PetscInt q = 0; q < f->element.nq; q++) {
    const PetscReal kept = e->mu[k * f->element.nq + q], rate = e->rate[k * f->element.nq + q];

    change      = PetscMax(change, kept > 0 ? PetscAbsReal(mu[q] - kept) * rate : PETSC_MAX_REAL);
    *stress_max = PetscMax(*stress_max, mu[q] * rate);
  }
  return change;
}

/* The viscosities that are asked for are in f->viscosity.mu: which multiple of the change to take (Aitken's method
   after Irons & Tuck, Int. J. Numer. Meth. Engng 1, 275, 1969), weighted by the stress */
static PetscErrorCode choose_relaxation(Flow f)
{
  const PetscInt nq     = f->element.nq;
  Extension      e      = FlowGeneralised(f)->extension;
  PetscReal      sum[2] = {0, 0};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < e->ncell * nq; i++) {
    const PetscReal mu = f->viscosity.mu[e->cell[i / nq] * nq + i % nq], change = PetscLogReal(mu / e->mu[i]),
                    gain = change - e->last[i];

    if (e->cell[i / nq] < f->loc->ncell) {
      sum[0] += PetscSqr(mu * e->rate[i]) * e->last[i] * gain;
      sum[1] += PetscSqr(mu * e->rate[i] * gain);
    }
    e->last[i] = change;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, f->comm));
  if (e->relaxation == 0 || sum[1] == 0) e->relaxation = 1;
  else e->relaxation = PetscMin(MAX_RELAXATION, PetscMax(MIN_RELAXATION, -e->relaxation * sum[0] / sum[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Viscosities of cut cells from the cells next to them, by the mode all or in part */
static PetscErrorCode continue_viscosity(Flow f)
{
  const PetscInt nq      = f->element.nq;
  Extension      e       = FlowGeneralised(f)->extension;
  PetscReal      size[2] = {0, 0}; /* change, largest stress */

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < e->nnode; k++)
    if (e->layer[e->node[k]] == 1) PetscCall(start_viscosity(f, e->node[k]));
  PetscCall(continue_field(f, 1, FAR));
  for (PetscInt k = 0; k < e->ncell; k++) {
    interpolate_viscosity(f, k, f->viscosity.mu + e->cell[k] * nq);
    size[0] = PetscMax(size[0], get_change(f, k, f->viscosity.mu + e->cell[k] * nq, &size[1]));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, size, 2, MPIU_REAL, MPIU_MAX, f->comm));
  e->change = size[1] > 0 ? size[0] / size[1] : PETSC_MAX_REAL;
  if (e->mode == CUT_RELAXED) PetscCall(choose_relaxation(f));
  for (PetscInt i = 0; i < e->ncell * nq; i++) {
    if (e->mode == CUT_UPDATE) e->mu[i] = f->viscosity.mu[e->cell[i / nq] * nq + i % nq];
    else e->mu[i] *= PetscExpReal(e->relaxation * e->last[i]);
  }
  if (e->mode == CUT_RELAXED) e->mode = CUT_FROZEN;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ExtensionApply(Flow f)
{
  const PetscInt  nq = f->element.nq;
  const Extension e  = FlowGeneralised(f)->extension;

  PetscFunctionBeginUser;
  if (!e) PetscFunctionReturn(PETSC_SUCCESS);
  if (e->mode != CUT_FROZEN) PetscCall(continue_viscosity(f));
  for (PetscInt k = 0; k < e->ncell; k++)
    PetscCall(PetscArraycpy(f->viscosity.mu + e->cell[k] * nq, e->mu + k * nq, nq));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ExtensionHas(Extension e, PetscInt c)
{
  return (PetscBool)(e && e->cut[c]);
}
