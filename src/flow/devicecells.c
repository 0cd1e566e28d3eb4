/* Devicecells: see devicecells.h */
#include "compat.h"
#include "devicecells.h"
#include "flow/device.h"
#include "lanes.h"

PetscInt FlowNumberHangs(const MeshLocal *l, PetscInt number[])
{
  PetscInt n = 0;

  for (PetscInt k = 0; k < MESH_HANG_CODES; k++) number[k] = -1;
  for (PetscInt c = 0; c < l->ncell; c++) {
    const MeshHang *h = MeshCellHang(l, c);

    if (h && number[h->code] < 0) number[h->code] = n++;
  }
  return n;
}

/* Those ways, hangs [*n] to be freed */
static PetscErrorCode list_hangs(const MeshLocal *l, PetscInt number[], int *n, DeviceHang **hangs)
{
  PetscFunctionBeginUser;
  *n = (int)FlowNumberHangs(l, number);
  PetscCall(PetscCalloc1(*n, hangs));
  for (PetscInt c = 0; c < l->ncell; c++) {
    const MeshHang *h  = MeshCellHang(l, c);
    DeviceHang     *to = h ? *hangs + number[h->code] : NULL;

    if (!h || to->n) continue;
    to->n = (int)h->n;
    for (PetscInt e = 0; e < 64; e++) to->corner[e] = h->corner[e / 8][e % 8];
    for (PetscInt r = 0; r < h->n; r++) to->slot[r] = (int)h->slot[r];
    for (PetscInt r = 0; r <= h->n; r++) to->start[r] = (int)h->start[r];
    for (PetscInt e = 0; e < h->start[h->n]; e++) {
      to->from[e]   = (int)h->from[e];
      to->weight[e] = h->weight[e];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Kind, nodes and geometry of n own cells, all or those of a list, whose nodes are its own then; positions of those
   that are no boxes, in their order */
static PetscErrorCode describe_cells(Flow f, PetscInt n, const PetscInt list[], int *node, unsigned char *kind,
                                     PetscReal *box, PetscReal *position)
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt c = list ? list[i] : i;
    LaneCells      one;

    for (PetscInt j = 0; j < 27; j++) node[i * 27 + j] = (int)(list ? i * 27 + j : l->cell_node[c * 27 + j]);
    LanesTake(f, 1, &c, &one);
    kind[i] = FlowIsInactive(f, c) ? DEVICE_NONE : one.box ? DEVICE_BOX : DEVICE_OTHER;
    if (kind[i] == DEVICE_BOX) {
      box[i * 4] = f->cells.det[c];
      for (PetscInt e = 0; e < 3; e++) box[i * 4 + 1 + e] = f->cells.inverse[c * 9 + e * 4];
    } else if (kind[i] == DEVICE_OTHER) {
      PetscCall(MeshCellCoordinates(f->mesh, c, position));
      position += 81;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscInt count_others(Flow f, PetscInt ncell, const PetscInt list[])
{
  PetscInt n = 0;

  for (PetscInt i = 0; i < ncell; i++) {
    LaneCells one;

    LanesTake(f, 1, list ? list + i : &i, &one);
    n += !one.box;
  }
  return n;
}

PetscErrorCode FlowCreateDeviceCells(Flow f, const DeviceQueue *queue, PetscInt n, const PetscInt list[],
                                     DeviceCells *cells)
{
  const MeshLocal *l = f->loc;
  PetscInt         number[MESH_HANG_CODES];
  DeviceHang      *hangs;
  DeviceMesh       m = {.nnode = (int)(list ? n * 27 : l->nnode_all), .ncell = (int)n};
  int             *node, *hang;
  unsigned char   *kind;
  PetscReal       *box, *position;

  PetscFunctionBeginUser;
  PetscCall(list_hangs(l, number, &m.nhang, &hangs));
  PetscCall(PetscMalloc5(n * 27, &node, n, &hang, n, &kind, n * 4, &box, count_others(f, n, list) * 81, &position));
  PetscCall(describe_cells(f, n, list, node, kind, box, position));
  for (PetscInt i = 0; i < n; i++) {
    const MeshHang *h = MeshCellHang(l, list ? list[i] : i);

    hang[i] = h ? (int)number[h->code] : -1;
  }
  m.node     = node;
  m.kind     = kind;
  m.hang     = m.nhang ? hang : NULL;
  m.hangs    = hangs;
  m.box      = box;
  m.position = position;
  PetscCallDevice(queue, DeviceCellsCreate(queue, &m, cells));
  PetscCall(PetscFree(hangs));
  PetscCall(PetscFree5(node, hang, kind, box, position));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void FlowGetDeviceForm(Flow f, DeviceForm *form, const PetscReal *nu[])
{
  *form = (DeviceForm){.a          = f->par.density * f->step.ct,
                       .b          = f->par.viscosity * f->step.theta,
                       .skew       = f->par.convection ? f->par.skew : 0,
                       .scale      = f->par.density * f->step.theta,
                       .convection = f->par.convection,
                       .vary       = f->viscosity.mu != NULL,
                       .nu_factor  = f->material ? f->material->factor * f->step.theta : 0};
  *nu   = f->viscosity.mu;
}

/* ---- B ---- */

/* b [81][4] <- that of a cell, whose pressures are its rows */
static void turn_matrix(const PetscReal from[], PetscInt stride, PetscReal to[])
{
  for (PetscInt k = 0; k < 4; k++)
    for (PetscInt i = 0; i < 81; i++) to[(i * 4 + k) * stride] = from[k * 81 + i];
}

/* Matrices that boxes of the places share, each once: kind [places], list [*n] borrowed matrices */
static void list_kinds(const struct _p_Flow *f, PetscInt n, const int cell[], int kind[], PetscInt *nkind,
                       const PetscReal *list[])
{
  PetscInt last = 0;

  *nkind = 0;
  for (PetscInt e = 0; e < n; e++) {
    const PetscReal *b = cell[e] < 0 ? NULL : f->cells.b[cell[e]];
    PetscInt         k = last;

    kind[e] = 0;
    if (!b) continue;
    if (*nkind == 0 || list[k] != b)
      for (k = 0; k < *nkind && list[k] != b;) k++;
    if (k == *nkind) list[(*nkind)++] = b;
    kind[e] = (int)(last = k);
  }
}

/* Inverse masses of the pressure: shared of the nkind matrices in list, own of the others */
static PetscErrorCode take_masses(Flow f, const DeviceQueue *queue, PetscInt nkind, const PetscReal *const list[],
                                  PetscInt nother, const int cell[], DeviceDivergence *d)
{
  PetscReal *shared, *own;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(nkind * 16, &shared, nother * 16, &own));
  for (PetscInt k = 0; k < nkind; k++) PetscCall(PetscArraycpy(shared + k * 16, list[k] + FlowDivergenceSize(f), 16));
  for (PetscInt e = 0; e < nother; e++)
    if (cell[e] >= 0) PetscCall(PetscArraycpy(own + e * 16, FlowPressureMass(f, cell[e]), 16));
    else PetscCall(PetscArrayzero(own + e * 16, 16));
  PetscCall(DeviceTake(queue, nkind * 16, shared, &d->shared_mass));
  PetscCall(DeviceTake(queue, nother * 16, own, &d->own_mass));
  PetscCall(PetscFree2(shared, own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCreateDeviceDivergence(Flow f, const DeviceQueue *queue, const DeviceCells *cells,
                                          const PetscInt of[], DeviceDivergence *d)
{
  const PetscInt    n = cells->ngroup * DEVICE_GROUP, nbox = cells->nbox * DEVICE_GROUP;
  const PetscReal **list;
  PetscReal        *shared, *own;
  PetscInt          nkind;
  int              *cell, *kind;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(n, &cell, nbox, &kind, nbox, &list, (n - nbox) * 324, &own));
  PetscCallDevice(queue, (*queue->run->download)(queue, (size_t)n * sizeof(*cell), cells->cell, cell));
  for (PetscInt e = 0; e < n && of; e++) cell[e] = cell[e] < 0 ? -1 : (int)of[cell[e]];
  list_kinds(f, nbox, cell, kind, &nkind, list);
  PetscCall(PetscMalloc1(nkind * 324, &shared));
  for (PetscInt k = 0; k < nkind; k++) turn_matrix(list[k], 1, shared + k * 324);
  for (PetscInt e = 0; e < n - nbox; e++) {
    const PetscInt c = cell[nbox + e] < 0 ? cell[nbox + e / DEVICE_GROUP * DEVICE_GROUP] : cell[nbox + e];

    turn_matrix(f->cells.b[c], DEVICE_GROUP, own + e / DEVICE_GROUP * 324 * DEVICE_GROUP + e % DEVICE_GROUP);
  }
  PetscCall(DeviceTake(queue, nbox, kind, &d->kind));
  PetscCall(DeviceTake(queue, nkind * 324, shared, &d->shared));
  PetscCall(DeviceTake(queue, (n - nbox) * 324, own, &d->own));
  PetscCall(take_masses(f, queue, nkind, list, n - nbox, cell + nbox, d));
  PetscCall(PetscFree(shared));
  PetscCall(PetscFree4(cell, kind, list, own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowDestroyDeviceDivergence(const DeviceQueue *queue, DeviceDivergence *d)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceFree(queue, &d->kind));
  PetscCall(DeviceFree(queue, &d->shared));
  PetscCall(DeviceFree(queue, &d->own));
  PetscCall(DeviceFree(queue, &d->shared_mass));
  PetscCall(DeviceFree(queue, &d->own_mass));
  PetscFunctionReturn(PETSC_SUCCESS);
}
