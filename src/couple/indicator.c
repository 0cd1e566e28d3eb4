/* Indicator: see indicator.h. */
#include "compat.h"
#include "base/agree.h"
#include "indicator.h"
#include "bodies/local.h"

#define CHUNK      256
#define SEEN       9    /* numbers of a body by which it is where it was */
#define ON_SURFACE 1e-9 /* of a cell, distance of a node that counts as inside, whatever the last bit of its place */

struct _p_Indicator {
  Mesh             mesh;
  Bodies           bodies;
  BodyState       *s;
  const MeshLocal *loc;
  PetscInt        *node_body, *node, nnode;  /* the claimed nodes */
  PetscInt        *cell, ncell, *stamp, now; /* stamp: number of the step that listed a cell */
  PetscReal       *seen, key; /* [nbodies][SEEN]: position, orientation, size, removed; key: NaN without */
};

PetscErrorCode IndicatorCreate(Mesh mesh, Bodies bodies, Indicator *indicator)
{
  Indicator m;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  m->mesh   = mesh;
  m->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &m->s));
  PetscCall(MeshGetLocal(mesh, &m->loc));
  PetscCall(PetscMalloc4(m->loc->nnode_all, &m->node_body, m->loc->nnode_all, &m->node, m->loc->ncell, &m->cell,
                         m->loc->ncell, &m->stamp));
  for (PetscInt i = 0; i < m->loc->nnode_all; i++) m->node_body[i] = -1;
  PetscCall(PetscArrayzero(m->stamp, m->loc->ncell));
  PetscCall(BodiesAttach(bodies, SEEN * sizeof(PetscReal), (void **)&m->seen));
  PetscCall(IndicatorInvalidate(m));
  *indicator = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorDestroy(Indicator *indicator)
{
  PetscFunctionBeginUser;
  if (!*indicator) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree4((*indicator)->node_body, (*indicator)->node, (*indicator)->cell, (*indicator)->stamp));
  PetscCall(BodiesDetach((*indicator)->bodies, (void **)&(*indicator)->seen));
  PetscCall(PetscFree(*indicator));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorInvalidate(Indicator m)
{
  PetscFunctionBeginUser;
  m->key = (PetscReal)NAN;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorIsCurrent(Indicator m, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal key, PetscBool *current)
{
  PetscBool other = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < SEEN * m->s->n; i++) {
    const PetscInt  k = i / SEEN, a = i % SEEN;
    const PetscReal now = a < 3 ? X[k][a] : a < 7 ? q[k][a - 3] : a == 7 ? m->s->scale[k] : m->s->removed[k];

    if (m->seen[i] != now) other = PETSC_TRUE;
    m->seen[i] = now;
  }
  PetscCall(BodiesAny(m->bodies, &other));
  *current = (PetscBool)(!other && (m->key == key || !m->s->nall));
  m->key   = key;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorClear(Indicator m)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->nnode; i++) m->node_body[m->node[i]] = -1;
  m->nnode = m->ncell = 0;
  m->now++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorAssign(Indicator m, PetscInt node, PetscInt body)
{
  PetscFunctionBeginUser;
  if (m->node_body[node] >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  m->node_body[node]  = body;
  m->node[m->nnode++] = node;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode assign_inside(Indicator m, PetscInt k, const PetscReal X[3], const PetscReal q[4])
{
  const PetscInt  dim    = m->loc->dim;
  const PetscReal radius = BodiesGetRadius(m->s, k) +
                           /* the search knows where nodes were before any move */
                           (m->loc->x != m->loc->x_start ? 2 * m->loc->h : 0);
  PetscReal       x[CHUNK * 3], d[CHUNK];
  const PetscInt *list;
  PetscInt        n;

  PetscFunctionBeginUser;
  PetscCall(MeshNodesInBox(m->mesh, X, radius * (1 + 1e-12), &n, &list));
  for (PetscInt begin = 0; begin < n; begin += CHUNK) {
    const PetscInt size = PetscMin(CHUNK, n - begin);

    for (PetscInt i = 0; i < size; i++)
      for (PetscInt a = 0; a < dim; a++) x[i * dim + a] = m->loc->x[list[begin + i] * dim + a];
    PetscCall(BodiesDistance(m->bodies, k, X, q, size, x, d));
    for (PetscInt i = 0; i < size; i++)
      if (d[i] <= ON_SURFACE * m->loc->h) PetscCall(IndicatorAssign(m, list[begin + i], k));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorInsideBody(Indicator m, PetscInt k, const PetscReal X[3], const PetscReal q[4])
{
  PetscFunctionBeginUser;
  if (m->s->removed[k] || BodiesGetGroup(m->s, k)->body_fitted) PetscFunctionReturn(PETSC_SUCCESS);
  for (DomainImages i = {0}; MeshNextImage(m->loc, X, BodiesGetRadius(m->s, k), &i);)
    PetscCall(assign_inside(m, k, i.at, q));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorInside(Indicator m, PetscReal (*X)[3], PetscReal (*q)[4])
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < m->s->n; k++) PetscCall(IndicatorInsideBody(m, k, X[k], q[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_seen(Indicator m, const PetscReal seen[])
{
  const MeshLocal *l = m->loc;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < m->s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(m->s, k);

    PetscCheck(seen[k] > 0 || m->s->removed[k] || g->body_fitted, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Body %" PetscInt_FMT
               " (group '%s', at %g,%g) covers no node of the mesh, so the flow does not see it; nodes are half a cell apart, the smallest cell is %g: "
               "refine the mesh (-mesh_cells, -dm_refine), make the body thicker, or use another -couple_method than nodal",
               m->s->number[k], g->name, (double)m->s->x[k][0], (double)m->s->x[k][1], (double)l->h);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorCheckSeen(Indicator m)
{
  PetscReal     *seen;
  PetscErrorCode wrong;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(m->s->n, &seen));
  for (PetscInt i = 0; i < m->nnode; i++) seen[m->node_body[m->node[i]]] = 1;
  PetscCall(BodiesSumLocal(m->bodies, 1, seen));
  AgreeEnter();
  wrong = AgreeReturn(check_seen(m, seen));
  PetscCall(PetscFree(seen));
  PetscCall(wrong);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorAddCells(Indicator m, PetscInt node)
{
  const MeshLocal *l = m->loc;

  PetscFunctionBeginUser;
  for (PetscInt q = l->node_cell_ptr[node]; q < l->node_cell_ptr[node + 1]; q++) {
    const PetscInt cell = l->node_cell[q];

    if (cell >= l->ncell || m->stamp[cell] == m->now) continue;
    m->stamp[cell]      = m->now;
    m->cell[m->ncell++] = cell;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorFinish(Indicator m)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m->nnode; i++) PetscCall(IndicatorAddCells(m, m->node[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorGetNodes(Indicator m, const PetscInt *node_body[], PetscInt *n, const PetscInt *node[])
{
  PetscFunctionBeginUser;
  if (node_body) *node_body = m->node_body;
  if (n) *n = m->nnode;
  if (node) *node = m->node;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode IndicatorGetCells(Indicator m, PetscInt *n, const PetscInt *cell[])
{
  PetscFunctionBeginUser;
  if (n) *n = m->ncell;
  if (cell) *cell = m->cell;
  PetscFunctionReturn(PETSC_SUCCESS);
}
