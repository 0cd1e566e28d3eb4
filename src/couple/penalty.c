/* Penalty: see penalty.h. */
#include "compat.h"
#include "penalty.h"
#include "base/opt.h"
#include "base/array.h"
#include "base/rigid.h"
#include "bodies/local.h"
#include "flow/condition.h"
#include "flow/device.h"

#define MIRROR 100

struct _p_Penalty {
  MPI_Comm         comm;
  Flow             flow;
  Bodies           bodies;
  BodyState       *s;
  Mesh             mesh;
  const MeshLocal *loc;
  PetscReal        viscous, inertial; /* a, b of sigma */
  PetscInt         nsample;
  CutCells         cut_cells;
  PetscBool        fresh; /* drawn, and not stiffened since */
  /* scalar part for the flow */
  PetscInt   nterm, term_capacity, *term_cell, *term_body;
  PetscReal *term; /* [nterm][nb*nb] */
  /* of the same, for a flow on a device (FlowMoments) */
  PetscInt    described_capacity, *without, nmoment, moment_capacity;
  DeviceBall *ball;
  PetscReal  *moment;
  PetscInt    slip_capacity;
  PetscReal  *slip; /* [nterm][nb*dim] of the body's surface, continued to the nodes of the cell; NULL: none */
  /* the rest */
  PenaltyTerm penalty_term;
  PetscInt    entry_capacity, more_capacity, *first, *next; /* entries of a node: first[node], next[entry]; -1 ends */
  PetscReal  *entry_weight;
  PetscReal (*P)[3];        /* [nbodies] reference points of the last draw */
  PetscInt *strong, *count; /* [nnode_all] */
};

/* Bodies of nodes: ghosts get what their owners have, by the numbers that bodies have on all ranks. Collective. */
static PetscErrorCode sync_bodies(Penalty p, PetscInt body[])
{
  const BodyState *s = p->s;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < p->loc->nnode; i++)
    if (body[i] >= 0) body[i] = s->number[body[i]];
  PetscCall(MeshSyncNodesInt(p->mesh, body));
  for (PetscInt i = 0; i < p->loc->nnode_all && s->n < s->nall; i++) {
    const PetscInt number = body[i];

    if (number < 0) continue;
    PetscCall(PetscFindInt(number, s->n, s->number, &body[i]));
    PetscCheck(body[i] >= 0, PETSC_COMM_SELF, PETSC_ERR_PLIB,
               "Body %" PetscInt_FMT " holds a node of a rank that does not know it", number);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- strong nodes ---- */

/* Is a node on a wall on which it slips? It is no body's in the constraint then. */
static PetscBool slips(Penalty p, const unsigned char fixed[], PetscInt node)
{
  return (PetscBool)(fixed[node] && fixed[node] != (1 << p->loc->dim) - 1);
}

/* Nodes all of whose cells lie inside the same body, but those that slip, on mirrors: the penalty holds them, MIRROR
   times as stiff. Parts are ordered by body, so counting restarts with each. */
static PetscErrorCode assign_strong_nodes(Penalty p, Indicator indicator)
{
  const MeshLocal     *l = p->loc;
  const unsigned char *fixed;
  const CutCell       *cut;
  PetscInt             ncut;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(p->flow), &fixed, NULL));
  PetscCall(CutCellsGet(p->cut_cells, &ncut, &cut));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    p->strong[i] = -1;
    p->count[i]  = 0;
  }
  for (PetscInt t = 0; t < ncut;) {
    const PetscInt k = cut[t].body, begin = t;

    for (; t < ncut && cut[t].body == k; t++) {
      if (cut[t].moments >= 0) continue;
      for (PetscInt j = 0; j < l->nb; j++) {
        const PetscInt i = l->cell_node[cut[t].cell * l->nb + j];

        if (++p->count[i] == l->node_cell_ptr[i + 1] - l->node_cell_ptr[i] && i < l->nnode && p->strong[i] < 0 &&
            !slips(p, fixed, i))
          p->strong[i] = k;
      }
    }
    for (PetscInt r = begin; r < t; r++)
      for (PetscInt j = 0; j < l->nb; j++) p->count[l->cell_node[cut[r].cell * l->nb + j]] = 0;
  }
  PetscCall(sync_bodies(p, p->strong));
  for (PetscInt i = 0; i < l->nnode_all; i++)
    if (p->strong[i] >= 0) PetscCall(IndicatorAssign(indicator, i, p->strong[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the penalty ---- */

/* sigma in a cell; stiff: its viscosity over that of the parameters */
static PetscErrorCode get_strength(Penalty p, PetscInt cell, PetscReal *sigma, PetscReal *stiff)
{
  const FlowParameters *par;
  const FlowStep       *step;
  const PetscReal      *size, *mu;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(p->flow, &par));
  PetscCall(FlowGetStep(p->flow, &step));
  PetscCall(FlowGetCellSize(p->flow, &size));
  PetscCall(FlowGetViscosity(p->flow, &mu, NULL)); /* known: add_penalties */
  *stiff = mu ? mu[cell] / par->viscosity : 1;
  *sigma = p->viscous * (mu ? mu[cell] : par->viscosity) / PetscSqr(size[cell]) + p->inertial * par->density * step->ct;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_entry(Penalty p, PetscInt node, PetscInt body, PetscInt *entry)
{
  PenaltyTerm *s = &p->penalty_term;
  PetscInt     e = p->first[node];

  PetscFunctionBeginUser;
  while (e >= 0 && s->body[e] != body) e = p->next[e];
  if (e < 0) {
    PetscCall(ArrayReserve(s->n + 1, &p->entry_capacity, &s->node, sizeof(*s->node), &s->body, sizeof(*s->body),
                           &p->next, sizeof(*p->next), &p->entry_weight, sizeof(*p->entry_weight), &s->g,
                           (s->dim + 1) * sizeof(*s->g), NULL));
    e                  = s->n++;
    s->node[e]         = node;
    s->body[e]         = body;
    p->entry_weight[e] = 0;
    for (PetscInt a = 0; a <= s->dim; a++) s->g[e * (s->dim + 1) + a] = 0;
    p->next[e]     = p->first[node];
    p->first[node] = e;
  }
  *entry = e;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* sum [1 + dim][nb] += pen 1 and pen x: the symmetric matrix by columns, all rows together in registers */
static void sum_columns(PetscInt nb, PetscInt dim, const PetscReal *restrict pen, const PetscReal x[],
                        PetscReal sum[4][MESH_MAX_NB])
{
  for (PetscInt j = 0; j < nb; j++) {
    const PetscReal *column = pen + j * nb;

    for (PetscInt i = 0; i < nb; i++) sum[0][i] += column[i];
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt i = 0; i < nb; i++) sum[1 + a][i] += column[i] * x[j * dim + a];
  }
}

/* Entries of the own nodes of a part with cell matrix pen; lumped with its diagonal scaled to the right sum (Hinton,
   Rock, Zienkiewicz 1976), which is always positive */
static PetscErrorCode add_entries(Penalty p, const CutCell *cut, const PetscReal pen[], PetscReal scale)
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nb = l->nb, *node = l->cell_node + cut->cell * nb;
  PetscReal        xc[MESH_MAX_NB * 3], sum[4][MESH_MAX_NB];
  PetscInt         entry[MESH_MAX_NB];

  PetscFunctionBeginUser;
  PetscCall(MeshSlotCoordinates(p->mesh, cut->cell, xc));
  for (PetscInt j = 0; j < nb * dim; j++) xc[j] -= cut->P[j % dim];
  for (PetscInt i = 0; i < nb; i++) {
    entry[i] = -1;
    if (node[i] >= l->nnode || p->strong[node[i]] == cut->body) continue;
    PetscCall(find_entry(p, node[i], cut->body, &entry[i]));
    p->entry_weight[entry[i]] += pen[i * (nb + 1)] * scale;
  }
  for (PetscInt a = 0; a <= dim; a++)
    for (PetscInt i = 0; i < nb; i++) sum[a][i] = entry[i] < 0 ? 0 : p->penalty_term.g[entry[i] * (dim + 1) + a];
  sum_columns(nb, dim, pen, xc, sum);
  for (PetscInt a = 0; a <= dim; a++)
    for (PetscInt i = 0; i < nb; i++)
      if (entry[i] >= 0) p->penalty_term.g[entry[i] * (dim + 1) + a] = sum[a][i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the diagonal of a cell matrix is to be multiplied by for its sum to be that of all entries */
static PetscReal lumping_scale(PetscInt nb, const PetscReal pen[])
{
  PetscReal row_sum[MESH_MAX_NB] = {0}, sum = 0, trace = 0;

  for (PetscInt i = 0; i < nb; i++) {
    for (PetscInt j = 0; j < nb; j++) row_sum[j] += pen[i * nb + j];
    trace += pen[i * (nb + 1)];
  }
  for (PetscInt j = 0; j < nb; j++) sum += row_sum[j];
  return sum / trace;
}

/* The same for a device, by its moments or by what these are drawn from */
static PetscErrorCode describe_term(Penalty p, const CutCell *cut, const PetscReal moment[], PetscReal sigma,
                                    const PetscBool strong[])
{
  PetscReal *to;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(p->nterm + 1, &p->described_capacity, &p->ball, sizeof(*p->ball), &p->without,
                         sizeof(*p->without), NULL));
  p->without[p->nterm] = 0;
  for (PetscInt j = 0; j < p->loc->nb; j++)
    if (strong[j]) p->without[p->nterm] |= 1 << j;
  PetscCall(CutCellsGetBall(p->cut_cells, cut, sigma, p->ball + p->nterm));
  if (p->ball[p->nterm].edge[0] > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(p->nmoment + 1, &p->moment_capacity, &p->moment, CUT_MOMENTS * sizeof(*p->moment), NULL));
  to = p->moment + p->nmoment++ * CUT_MOMENTS;
  for (PetscInt e = 0; e < CUT_MOMENTS; e++) to[e] = sigma * moment[e];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The flow learns its part */
static PetscErrorCode hand_over(Penalty p)
{
  const FlowMoments moments = {p->without, p->ball, p->nsample, p->moment};

  PetscFunctionBeginUser;
  PetscCall(FlowAddCellTerms(p->flow, p, p->nterm, p->term_cell, p->term));
  if (FlowGetQueue(p->flow)) PetscCall(FlowDescribeCellTerms(p->flow, p, &moments));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The cell matrix of a part: rows and columns of nodes that are strong in the same body are left out, because the
   penalty of a rigid motion is zero anyway */
static PetscErrorCode add_cut_penalty(Penalty p, const CutCell *cut)
{
  const MeshLocal     *l  = p->loc;
  const PetscInt       nb = l->nb, *node = l->cell_node + cut->cell * nb;
  const unsigned char *fixed;
  const PetscReal     *moment;
  PetscReal           *pen, scale, sigma = 0, stiff = 1;
  PetscBool            strong[MESH_MAX_NB], any = PETSC_FALSE, all = PETSC_TRUE, mirror = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(p->flow), &fixed, NULL));
  for (PetscInt j = 0; j < nb; j++) {
    strong[j] = (PetscBool)(p->strong[node[j]] == cut->body);
    any       = (PetscBool)(any || strong[j]);
    all       = (PetscBool)(all && strong[j]);
    mirror    = (PetscBool)(mirror || (cut->moments < 0 && slips(p, fixed, node[j])));
  }
  if (all) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(get_strength(p, cut->cell, &sigma, &stiff));
  p->penalty_term.strength = PetscMax(p->penalty_term.strength, sigma / stiff);
  if (mirror) sigma *= MIRROR;
  PetscCall(ArrayReserve(p->nterm + 1, &p->term_capacity, &p->term_cell, sizeof(*p->term_cell), &p->term_body,
                         sizeof(*p->term_body), &p->term, nb * nb * sizeof(*p->term), NULL));
  pen = p->term + p->nterm * nb * nb;
  PetscCall(CutCellsGetMoments(p->cut_cells, cut, &moment));
  CutCellsGetMatrix(p->cut_cells, cut, moment, sigma, pen);
  scale = lumping_scale(nb, pen);
  for (PetscInt i = 0; i < nb && any; i++)
    for (PetscInt j = 0; j < nb; j++)
      if (strong[i] || strong[j]) pen[i * nb + j] = 0;
  PetscCall(add_entries(p, cut, pen, scale));
  if (FlowGetQueue(p->flow)) PetscCall(describe_term(p, cut, moment, sigma, strong));
  p->term_cell[p->nterm]   = cut->cell;
  p->term_body[p->nterm++] = cut->body;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* This rank's part of H, lumped weights and the body that each node follows, from the entries */
static PetscErrorCode finish_penalty_term(Penalty p, PetscReal (*P)[3])
{
  const MeshLocal *l  = p->loc;
  PenaltyTerm     *s  = &p->penalty_term;
  const PetscInt   nr = s->nr, dim = s->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(s->H, p->s->n * nr * nr));
  PetscCall(PetscArrayzero(s->weight, l->nnode_all));
  for (PetscInt i = 0; i < l->nnode_all; i++) s->relative_to[i] = -1;
  PetscCall(ArrayReserve(s->n, &p->more_capacity, &s->more, sizeof(*s->more), NULL));
  s->nmore = 0;
  for (PetscInt e = 0; e < s->n; e++) {
    const PetscInt i = s->node[e], k = s->body[e];
    PetscReal      G[18], R[18];

    PenaltyTermGetBlock(s, e, G);
    ConstraintRigidAt(l, i, P[k], R);
    for (PetscInt m = 0; m < nr * nr; m++)
      for (PetscInt a = 0; a < dim; a++) s->H[k * nr * nr + m] += R[a * nr + m / nr] * G[a * nr + m % nr];
    s->weight[i] += p->entry_weight[e];
    if (e == p->first[i]) { /* once a node */
      PetscInt best = e;

      for (PetscInt o = e; o >= 0; o = p->next[o])
        if (p->entry_weight[o] > p->entry_weight[best] ||
            (p->entry_weight[o] == p->entry_weight[best] && s->body[o] < s->body[best]))
          best = o;
      s->relative_to[i] = s->body[best];
    }
    if (!s->nmore || s->more[s->nmore - 1] != k) s->more[s->nmore++] = k;
  }
  s->any = (PetscBool)(s->n > 0);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &s->any, 1, COMPAT_MPI_BOOL, MPI_LOR, p->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &s->strength, 1, MPIU_REAL, MPIU_MAX, p->comm));
  PetscCall(MeshSyncNodes(p->mesh, 1, s->weight));
  PetscCall(sync_bodies(p, s->relative_to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All terms from the parts as they are cut */
static PetscErrorCode add_penalties(Penalty p)
{
  const CutCell *cut;
  PetscInt       ncut;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < p->penalty_term.n; e++) p->first[p->penalty_term.node[e]] = -1;
  p->penalty_term.n = p->nterm = p->nmoment = 0;
  p->penalty_term.strength                  = 0;
  PetscCall(FlowGetViscosity(p->flow, NULL, NULL)); /* by all ranks, before each asks for that of its cells */
  PetscCall(CutCellsGet(p->cut_cells, &ncut, &cut));
  for (PetscInt t = 0; t < ncut; t++) PetscCall(add_cut_penalty(p, cut + t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The flow learns which cells its velocity is not that of the fluid alone in */
static PetscErrorCode set_cut_cells(Penalty p)
{
  const CutCell *cut;
  PetscInt       ncut, *cell;

  PetscFunctionBeginUser;
  if (!FlowHasSymmetricStress(p->flow)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CutCellsGet(p->cut_cells, &ncut, &cut));
  PetscCall(PetscMalloc1(ncut, &cell));
  for (PetscInt t = 0; t < ncut; t++) cell[t] = cut[t].cell;
  PetscCall(FlowSetCutCells(p->flow, ncut, cell));
  PetscCall(PetscFree(cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyStiffen(Penalty p, PetscBool *changed)
{
  const FlowStep *step;
  PetscBool       fresh = p->fresh;

  PetscFunctionBeginUser;
  p->fresh = PETSC_FALSE;
  PetscCall(FlowGetStep(p->flow, &step));
  *changed = (PetscBool) !(fresh && step->dt > 0);
  if (!*changed) PetscFunctionReturn(PETSC_SUCCESS); /* the viscosity of a step is known when it is drawn */
  PetscCall(add_penalties(p));
  PetscCall(finish_penalty_term(p, p->P));
  PetscCall(hand_over(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyUpdateGeometry(Penalty         p, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal (*P)[3],
                                     const PetscBool omit[], Indicator indicator)
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy((PetscReal *)p->P, (PetscReal *)P, 3 * p->s->n));
  PetscCall(CutCellsCut(p->cut_cells, X, q, P, omit));
  PetscCall(assign_strong_nodes(p, indicator));
  PetscCall(set_cut_cells(p));
  PetscCall(add_penalties(p));
  p->fresh = PETSC_TRUE;
  for (PetscInt e = 0; e < p->penalty_term.n; e++) PetscCall(IndicatorAddCells(indicator, p->penalty_term.node[e]));
  PetscCall(finish_penalty_term(p, P));
  PetscCall(hand_over(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyGetTerm(Penalty p, const PenaltyTerm **penalty_term)
{
  PetscFunctionBeginUser;
  *penalty_term = &p->penalty_term;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does term t act on components that are fixed? */
static PetscBool meets_fixed(const struct _p_Penalty *p, PetscInt t, const unsigned char fixed[])
{
  const PetscInt *node = p->loc->cell_node + p->term_cell[t] * p->loc->nb;
  PetscInt        any  = 0;

  for (PetscInt j = 0; j < p->loc->nb; j++) any |= fixed[node[j]];
  return (PetscBool)(any && p->term_cell[t] < p->loc->ncell);
}

PetscErrorCode PenaltyListPrescribed(Penalty p, const unsigned char fixed[], PetscInt *n, PetscInt *node[])
{
  const PetscInt nb = p->loc->nb;

  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt t = 0; t < p->nterm; t++) *n += meets_fixed(p, t, fixed) ? nb : 0;
  PetscCall(PetscMalloc1(*n, node));
  *n = 0;
  for (PetscInt t = 0; t < p->nterm; t++) {
    if (!meets_fixed(p, t, fixed)) continue;
    PetscCall(PetscArraycpy(*node + *n, p->loc->cell_node + p->term_cell[t] * nb, nb));
    *n += nb;
  }
  PetscCall(PetscSortRemoveDupsInt(n, *node));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyAddPrescribed(Penalty p, const unsigned char fixed[], const PetscReal u[], const PetscReal U[],
                                    PetscReal out[3])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nr = p->penalty_term.nr;

  PetscFunctionBeginUser;
  for (PetscInt t = 0; t < p->nterm; t++) {
    const PetscInt  *node = l->cell_node + p->term_cell[t] * nb, k = p->term_body[t];
    const PetscReal *pen = p->term + t * nb * nb;
    PetscReal        slip[MESH_MAX_NB * 3];

    if (!meets_fixed(p, t, fixed)) continue;
    for (PetscInt j = 0; j < nb; j++) {
      PetscReal R[18];

      ConstraintRigidAt(l, node[j], p->P[k], R);
      for (PetscInt a = 0; a < dim; a++) {
        slip[j * dim + a] = u[node[j] * dim + a] - (p->slip ? p->slip[(t * nb + j) * dim + a] : 0);
        for (PetscInt m = 0; m < nr; m++) slip[j * dim + a] -= R[a * nr + m] * U[k * nr + m];
      }
    }
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt j = 0; j < nb; j++)
        for (PetscInt a = 0; a < dim; a++)
          if ((fixed[node[i]] >> a) & 1) out[a] += pen[i * nb + j] * slip[j * dim + a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- surfaces that move beside the rigid motion ---- */

/* y [nb][dim] = Pen x of a term */
static void multiply_term(const struct _p_Penalty *p, PetscInt t, const PetscReal x[], PetscReal y[])
{
  const PetscInt   dim = p->loc->dim, nb = p->loc->nb;
  const PetscReal *pen = p->term + t * nb * nb;

  for (PetscInt i = 0; i < nb; i++)
    for (PetscInt a = 0; a < dim; a++) {
      y[i * dim + a] = 0;
      for (PetscInt j = 0; j < nb; j++) y[i * dim + a] += pen[i * nb + j] * x[j * dim + a];
    }
}

PetscErrorCode PenaltySetSlip(Penalty p, PenaltySlip slip, void *ctx, PetscReal force[], PetscReal body[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nr = p->penalty_term.nr;
  PetscReal        y[MESH_MAX_NB * 3], R[18];

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(p->nterm + 1, &p->slip_capacity, &p->slip, nb * dim * sizeof(*p->slip), NULL));
  for (PetscInt t = 0; t < p->nterm; t++) {
    const PetscInt *node = l->cell_node + p->term_cell[t] * nb, k = p->term_body[t];
    PetscReal      *s = p->slip + t * nb * dim;

    PetscCall(PetscArrayzero(s, nb * dim));
    if (!BodiesGetGroup(p->s, k)->slip) continue;
    for (PetscInt j = 0; j < nb; j++) PetscCall((*slip)(ctx, k, node[j], s + j * dim));
    if (p->term_cell[t] >= l->ncell) continue;
    multiply_term(p, t, s, y);
    for (PetscInt i = 0; i < nb; i++) {
      ConstraintRigidAt(l, node[i], p->P[k], R);
      for (PetscInt a = 0; a < dim; a++) {
        force[node[i] * dim + a] += y[i * dim + a];
        for (PetscInt m = 0; m < nr; m++) body[k * nr + m] += R[a * nr + m] * y[i * dim + a];
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyAddSlipPower(Penalty p, const PetscReal u[], const PetscReal U[], PetscReal power[],
                                   PetscReal penalty_force[])
{
  const MeshLocal *l   = p->loc;
  const PetscInt   dim = l->dim, nb = l->nb, nr = p->penalty_term.nr;
  PetscReal        y[MESH_MAX_NB * 3], R[18];

  PetscFunctionBeginUser;
  for (PetscInt t = 0; t < p->nterm && p->slip; t++) {
    const PetscInt  *node = l->cell_node + p->term_cell[t] * nb, k = p->term_body[t];
    const PetscReal *s = p->slip + t * nb * dim;

    if (p->term_cell[t] >= l->ncell) continue;
    multiply_term(p, t, s, y);
    for (PetscInt i = 0; i < nb; i++) {
      ConstraintRigidAt(l, node[i], p->P[k], R);
      for (PetscInt a = 0; a < dim; a++) {
        PetscReal v = u[node[i] * dim + a];

        for (PetscInt m = 0; m < nr; m++) v -= R[a * nr + m] * U[k * nr + m];
        if (power) power[k] += y[i * dim + a] * (s[i * dim + a] - v);
        if (penalty_force) penalty_force[k] += y[i * dim + a] * v;
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyGetCutCells(Penalty p, CutCells *cut_cells)
{
  PetscFunctionBeginUser;
  *cut_cells = p->cut_cells;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode PenaltyCreate(Flow flow, Bodies bodies, Penalty *penalty)
{
  Penalty      p;
  PenaltyTerm *s;
  PetscInt     n;
  PetscBool    still;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  s         = &p->penalty_term;
  p->flow   = flow;
  p->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &p->s));
  PetscCall(FlowGetMesh(flow, &p->mesh));
  PetscCall(MeshGetComm(p->mesh, &p->comm));
  PetscCall(MeshGetLocal(p->mesh, &p->loc));
  p->viscous  = 200;
  p->inertial = 12;
  PetscCall(BodiesAreStill(bodies, &still));
  p->nsample = still ? 20 : 10; /* drawn once, or in every step */
  PetscCall(OptReal("-couple_penalty_viscous", &p->viscous));
  PetscCall(OptReal("-couple_penalty_inertial", &p->inertial));
  PetscCall(OptInt("-couple_penalty_samples", &p->nsample));
  PetscCheck(p->viscous > 0 || p->inertial > 0, p->comm, PETSC_ERR_USER_INPUT,
             "-couple_penalty_viscous and -couple_penalty_inertial are both 0: nothing would hold the fluid at the surface of the bodies");
  PetscCall(CutCellsCreate(flow, bodies, p->nsample, &p->cut_cells));
  n      = p->loc->nnode_all;
  s->dim = p->loc->dim;
  s->nr  = RigidSize(s->dim);
  PetscCall(PetscMalloc3(n, &p->first, n, &p->strong, n, &p->count));
  PetscCall(PetscCalloc2(n, &s->weight, n, &s->relative_to));
  PetscCall(BodiesAttachWork(bodies, 3 * sizeof(PetscReal), (void **)&p->P));
  PetscCall(BodiesAttachWork(bodies, (size_t)(s->nr * s->nr) * sizeof(PetscReal), (void **)&s->H));
  PetscCall(BodiesAttachWork(bodies, (size_t)(s->nr * s->nr) * sizeof(PetscReal), (void **)&s->whole));
  for (PetscInt i = 0; i < n; i++) p->first[i] = s->relative_to[i] = -1;
  *penalty = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyDestroy(Penalty *penalty)
{
  Penalty p = *penalty;

  PetscFunctionBeginUser;
  if (!p) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowAddCellTerms(p->flow, p, 0, NULL, NULL));
  PetscCall(PetscFree3(p->first, p->strong, p->count));
  PetscCall(PetscFree2(p->penalty_term.weight, p->penalty_term.relative_to));
  PetscCall(BodiesDetach(p->bodies, (void **)&p->P));
  PetscCall(BodiesDetach(p->bodies, (void **)&p->penalty_term.H));
  PetscCall(BodiesDetach(p->bodies, (void **)&p->penalty_term.whole));
  PetscCall(CutCellsDestroy(&p->cut_cells));
  PetscCall(PetscFree(p->term_cell));
  PetscCall(PetscFree(p->term_body));
  PetscCall(PetscFree(p->term));
  PetscCall(PetscFree(p->slip));
  PetscCall(PetscFree(p->moment));
  PetscCall(PetscFree(p->without));
  PetscCall(PetscFree(p->ball));
  PetscCall(PetscFree(p->penalty_term.node));
  PetscCall(PetscFree(p->penalty_term.body));
  PetscCall(PetscFree(p->penalty_term.g));
  PetscCall(PetscFree(p->penalty_term.more));
  PetscCall(PetscFree(p->next));
  PetscCall(PetscFree(p->entry_weight));
  PetscCall(PetscFree(*penalty));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PenaltyView(Penalty p, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer,
                                   "  penalty %g viscosity/h^2 + %g density/time step, %" PetscInt_FMT
                                   " sub-cells an axis\n",
                                   (double)p->viscous, (double)p->inertial, p->nsample));
  PetscFunctionReturn(PETSC_SUCCESS);
}
