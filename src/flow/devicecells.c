/* Devicecells: see devicecells.h */
#include "compat.h"
#include "devicecells.h"
#include "lanes.h"

/* Ways in which something hangs, each once: number [MESH_HANG_CODES] by code, hangs [*n] to be freed */
static PetscErrorCode list_hangs(const MeshLocal *l, PetscInt number[], int *n, DeviceHang **hangs)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < MESH_HANG_CODES; k++) number[k] = -1;
  *n     = 0;
  *hangs = NULL;
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt c = 0; c < l->ncell; c++) {
      const MeshHang *h = MeshCellHang(l, c);
      DeviceHang     *to;

      if (!h || (number[h->code] >= 0) == (pass == 0)) continue;
      if (pass == 0) {
        number[h->code] = (*n)++;
        continue;
      }
      to    = *hangs + number[h->code];
      to->n = (int)h->n;
      for (PetscInt r = 0; r < h->n; r++) to->slot[r] = (int)h->slot[r];
      for (PetscInt r = 0; r <= h->n; r++) to->start[r] = (int)h->start[r];
      for (PetscInt e = 0; e < h->start[h->n]; e++) {
        to->from[e]   = (int)h->from[e];
        to->weight[e] = h->weight[e];
      }
    }
    if (pass == 0) PetscCall(PetscCalloc1(*n, hangs));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Kind, nodes and geometry of every own cell; m->position grows by one for those that are no boxes */
static PetscErrorCode describe_cells(Flow f, int *node, unsigned char *kind, PetscReal *box, PetscReal *position)
{
  const MeshLocal *l = f->loc;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < l->ncell; c++) {
    LaneCells one;

    for (PetscInt j = 0; j < 27; j++) node[c * 27 + j] = (int)l->cell_node[c * 27 + j];
    LanesTake(f, 1, &c, &one);
    kind[c] = FlowIsInactive(f, c) ? DEVICE_NONE : one.box ? DEVICE_BOX : DEVICE_OTHER;
    if (kind[c] == DEVICE_BOX) {
      box[c * 4] = f->cells.det[c];
      for (PetscInt e = 0; e < 3; e++) box[c * 4 + 1 + e] = f->cells.inverse[c * 9 + e * 4];
    } else if (kind[c] == DEVICE_OTHER) {
      PetscCall(MeshCellCoordinates(f->mesh, c, position));
      position += 81;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscInt count_others(Flow f)
{
  PetscInt n = 0;

  for (PetscInt c = 0; c < f->loc->ncell; c++) {
    LaneCells one;

    LanesTake(f, 1, &c, &one);
    n += !one.box;
  }
  return n;
}

PetscErrorCode FlowCreateDeviceCells(Flow f, const DeviceQueue *queue, DeviceCells *cells)
{
  const MeshLocal *l = f->loc;
  const PetscInt   n = l->ncell;
  PetscInt         number[MESH_HANG_CODES];
  DeviceHang      *hangs;
  DeviceMesh       m = {.nnode = (int)l->nnode_all, .ncell = (int)n};
  int             *node, *hang, failed;
  unsigned char   *kind;
  PetscReal       *box, *position;

  PetscFunctionBeginUser;
  PetscCheck(l->dim == 3, PETSC_COMM_SELF, PETSC_ERR_SUP, "Kernels of devices are for meshes in space");
  PetscCheck(l->nnode_all < DEVICE_MAX_NODES, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%lld nodes on a rank: a device takes less than %d (more ranks, a coarser -mesh_cells)",
             (long long)l->nnode_all, DEVICE_MAX_NODES);
  PetscCall(list_hangs(l, number, &m.nhang, &hangs));
  PetscCall(PetscMalloc5(n * 27, &node, n, &hang, n, &kind, n * 4, &box, count_others(f) * 81, &position));
  PetscCall(describe_cells(f, node, kind, box, position));
  for (PetscInt c = 0; c < n; c++) hang[c] = MeshCellHang(l, c) ? (int)number[MeshCellHang(l, c)->code] : -1;
  m.node     = node;
  m.kind     = kind;
  m.hang     = m.nhang ? hang : NULL;
  m.hangs    = hangs;
  m.box      = box;
  m.position = position;
  failed     = DeviceCellsCreate(queue, &m, cells);
  PetscCheck(!failed, PETSC_COMM_SELF, PETSC_ERR_LIB, "Cells on the device: %s", (*queue->run->explain)(failed));
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
