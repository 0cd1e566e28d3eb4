/* CoupleDrops, mesh: the interface predicted, the mesh lined up with it, who is who. */
#include "compat.h"
#include "drops.h"
#include "feet.h"
#include "impl.h"
#include "scalarphases.h"
#include "base/array.h"

/* Of the smallest cell: the most that the volume moves the interface in a step. 1e-5 as a rule; more where drops of a
   cell are lined up, necks have vanished, or interfaces are drawn anew beside bodies that they wet. */
#define SHIFT      0.1
#define DRAWINGS   3 /* beside bodies at first, in which interfaces come to their contact angle: a cell */
#define PASSES     2
#define MIN_VOLUME 0.01 /* of a cell: that a part has, folded as it may be */

/* Edges of a cell in the plane, the cell on their left */
static const PetscInt ROUND[4][3] = {{0, 1, 2}, {2, 5, 8}, {8, 7, 6}, {6, 3, 0}};

/* ---- the interface ---- */

PetscErrorCode DropsCellCoordinates(const CoupleDrops *f, Couple c, PetscInt cell, const PetscReal way[],
                                    PetscReal xc[])
{
  const PetscInt *node = c->loc->cell_node + cell * c->loc->nb, dim = c->loc->dim;

  PetscFunctionBeginUser;
  PetscCall(MeshCellCoordinates(c->mesh, cell, xc));
  for (PetscInt j = 0; j < dim * c->loc->nb && way; j++) xc[j] += way[dim * node[j / dim] + j % dim];
  for (PetscInt j = 0; j < dim * c->loc->nb && f->result.rest; j++)
    xc[j] += f->result.rest[dim * node[j / dim] + j % dim];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode gather_curve(CoupleDrops *f, Couple c, const PetscInt cell_drop[], const PetscReal way[],
                                   PhaseCurve *curve)
{
  const MeshLocal *l = c->loc;
  PetscInt         n = 0, capacity = 0;
  PhaseEdge       *edge = NULL;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell; e++) {
    const PetscInt *node = l->cell_node + e * l->nb;
    PetscReal       xc[18];

    if (cell_drop[e] < 0) continue;
    PetscCall(DropsCellCoordinates(f, c, e, way, xc));
    for (PetscInt s = 0; s < 4; s++) {
      const PetscInt  middle = node[ROUND[s][1]];
      const PetscBool wall   = DropsIsBoundary(l, middle);

      if (!wall && !DropsIsInterface(l, cell_drop, middle)) continue;
      PetscCall(ArrayReserve(n + 1, &capacity, &edge, sizeof(*edge), NULL));
      edge[n].drop = (PetscReal)cell_drop[e];
      edge[n].wall = wall ? 1 : 0;
      for (PetscInt j = 0; j < 3; j++)
        for (PetscInt a = 0; a < 2; a++) {
          const PetscInt slot = ROUND[s][j];

          edge[n].key[j][a] = l->x_start[2 * node[slot] + a];
          edge[n].x[j][a]   = xc[2 * slot + a];
        }
      n++;
    }
  }
  PetscCall(PhaseCurveGather(c->comm, n, edge, l->period, curve));
  PetscCall(PetscFree(edge));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsGather(CoupleDrops *f, Couple c, const PetscInt cell_drop[], const PetscReal way[],
                           PhaseInterface *now)
{
  PetscFunctionBeginUser;
  *now = (PhaseInterface){0};
  if (f->regular) PetscCall(DropsMoveCurve(f, c, way, &now->curve));
  else if (c->loc->dim == 2) PetscCall(gather_curve(f, c, cell_drop, way, &now->curve));
  else PetscCall(DropsGatherSheet(f, c, cell_drop, way, &now->sheet));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* f->way: displacement of the fluid in this step */
static PetscErrorCode find_way(CoupleDrops *f, Couple c)
{
  const PetscInt n = c->loc->dim * c->loc->nnode_all;

  PetscFunctionBeginUser;
  PetscCall(FeetPredict(c->flow, c->step, f->first_order, n, f->way));
  for (PetscInt i = 0; i < n; i++) f->way[i] += f->corr[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsKeepVolumes(CoupleDrops *f, Couple c, PhaseInterface *now, PetscReal *way)
{
  PetscFunctionBeginUser;
  *way = 0;
  for (PetscInt pass = 0; pass < PASSES; pass++) {
    PetscReal largest = 0;

    for (PetscInt k = 0; k < f->s->n; k++) {
      const Drop     *d    = f->s->drop + k;
      const PetscReal most = (f->met > 1 && f->met <= 1 + DRAWINGS ? 1 : SHIFT) * c->loc->h / PASSES;
      PetscReal       shift;
      PhaseSums       sums;

      PhaseInterfaceMeasure(now, d->number, &sums);
      if (sums.length <= 0) continue;
      shift = PetscMax(-most, PetscMin(most, (d->target + d->inside - sums.area) / sums.length));
      PetscCall(PhaseInterfaceShift(now, d->number, shift));
      largest = PetscMax(largest, PetscAbsReal(shift) / c->loc->h);
    }
    *way += largest;
    PhaseInterfaceUpdate(now);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In space: error, a region reaches a side that is none or that it does not wet. Collective. */
static PetscErrorCode check_sides(CoupleDrops *f, Couple c)
{
  const MeshLocal *l    = c->loc;
  const PetscInt  *wets = PhaseSurfacesGet(f->surfaces)->ends_on;
  PetscInt         at   = 0, side; /* 1 + side, 8 times, and group */
  PetscBool        any  = PETSC_FALSE;
  const char      *name;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < f->s->ngroups; g++) any = (PetscBool)(any || f->s->group[g].region);
  for (PetscInt i = 0; i < 6 * l->nnode && any; i++) {
    const PetscReal *x = l->x_start + 3 * (i / 6), edge = i % 2 ? l->upper[i % 6 / 2] : l->lower[i % 6 / 2];
    PetscInt         group;
    PetscReal        d;

    if (x[i % 6 / 2] != edge || (l->period[i % 6 / 2] == 0 && wets && *wets >> i % 6 & 1)) continue;
    PetscCall(DropsStartNearest(f->drops, x, &group, &d));
    if (d < 0 && f->s->group[group].region) at = PetscMax(at, 8 * group + 1 + i % 6);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at, 1, MPIU_INT, MPI_MAX, c->comm));
  if (!at) PetscFunctionReturn(PETSC_SUCCESS);
  side = (at - 1) % 8;
  name = f->s->group[(at - 1) / 8].name;
  PetscCheck(l->period[side / 2] == 0, c->comm, PETSC_ERR_SUP,
             "-particle_%s_region reaches over a period of the mesh, which drops given by a region cannot yet: remove -mesh_periodic, or keep "
             "the region inside",
             name);
  SETERRQ(c->comm, PETSC_ERR_USER_INPUT,
          "The fluid '%s' reaches the side %c = %g of the domain, which it does not wet: keep it a cell away from there, or give "
          "-particle_%s_contact_angle, and that side -flow_bc_<boundary>_type slip",
          name, "xyz"[side / 2], (double)(side % 2 ? l->upper : l->lower)[side / 2], name);
}

/* In the plane the curve of the start; in space there is none, and PhaseSurfaces asks the shapes */
static PetscErrorCode start_curve(CoupleDrops *f, Couple c)
{
  const PetscInt *wets = PhaseSurfacesGet(f->surfaces)->ends_on;
  PhaseBox        box  = {.h = c->loc->h, .wets = wets ? *wets : 0};

  PetscFunctionBeginUser;
  if (c->loc->dim == 3) {
    PetscCall(DropsStartBox(f->drops, c->loc->lower, c->loc->upper));
    PetscCall(check_sides(f, c));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt a = 0; a < 2; a++) {
    box.lower[a]  = c->loc->lower[a];
    box.upper[a]  = c->loc->upper[a];
    box.period[a] = c->loc->period[a];
  }
  PetscCall(DropsStart(f->drops, &box, &f->interface.curve));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsPredict(CoupleDrops *f, Couple c)
{
  PhaseInterface now;
  PetscReal      way;

  PetscFunctionBeginUser;
  if (!f->lined_up) {
    PetscCall(start_curve(f, c));
    PetscCall(DropsCheckOverlap(f, c));
    PetscCall(DropsCheckMirrors(f, c));
    PetscCall(PetscArrayzero(f->way, c->loc->dim * c->loc->nnode_all));
    f->first_order = PETSC_TRUE;
  } else {
    PetscCall(find_way(f, c));
    PetscCall(DropsGather(f, c, f->cell_drop, f->way, &now));
    PetscCall(DropsLetLeave(f, c, &now));
    PetscCall(PhaseInterfaceDestroy(&f->interface));
    f->interface = now;
    PetscCall(DropsMeetBodies(f, c));
    PetscCall(DropsKeepVolumes(f, c, &f->interface, &way));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the mesh ---- */

PetscErrorCode DropsSetProperties(CoupleDrops *f, Couple c)
{
  PetscInt *phase;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->loc->ncell_all, &phase));
  for (PetscInt e = 0; e < c->loc->ncell_all; e++) {
    const PetscInt   k = DropsFind(f->s, f->cell_drop[e]);
    const DropGroup *g = k < 0 ? NULL : f->s->group + f->s->drop[k].group;

    phase[e]      = g ? f->s->drop[k].group : -1;
    f->density[e] = g ? g->density : c->par->density;
    if (f->fraction) f->density[e] = c->par->density + f->fraction[e] * (f->density[e] - c->par->density);
    f->viscosity[e] = g && g->viscosity > 0 ? g->viscosity : c->par->viscosity;
    if (f->regular) f->viscosity[e] = c->par->viscosity + f->fraction[e] * (f->viscosity[e] - c->par->viscosity);
  }
  PetscCall(FlowSetProperties(c->flow, f->density, f->viscosity));
  PetscCall(CoupleSetPhases(c, phase, NULL, NULL));
  PetscCall(PetscFree(phase));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Drops have merged or broken up: the velocity of the step before says nothing of this one, which is as a first one */
static PetscErrorCode begin_anew(CoupleDrops *f, Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(FlowForgetHistory(c->flow));
  if (f->kept) PetscFunctionReturn(PETSC_SUCCESS); /* between two steps */
  PetscCall(FlowBeginStep(c->flow, c->step->time, c->step->dt));
  for (PetscInt i = 0; i < c->loc->dim * c->loc->nnode_all; i++) f->velocity[i] = c->step->d0 * f->shift[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsName(CoupleDrops *f, Couple c, PetscInt n, const PhaseInterface *now, PetscInt number[])
{
  PetscReal *volume;
  PetscBool  changed;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &volume));
  for (PetscInt i = 0; i < n; i++) {
    PhaseSums sums;

    PhaseInterfaceMeasure(now, i, &sums);
    volume[i] = PetscMax(sums.area, MIN_VOLUME * PetscPowRealInt(c->loc->h, (int)c->loc->dim));
  }
  PetscCall(DropsInherit(f->drops, &f->interface, now, n, volume, number, &changed));
  if (!f->lined_up) PetscCall(DropsCheckStart(f, c, n, volume, number));
  PetscCheck(f->s->n || f->s->left, c->comm, PETSC_ERR_USER_INPUT,
             "The last drop has vanished at t = %g: it had no cell's middle in it any more: use smaller cells (-mesh_cells)",
             (double)c->step->time);
  if (changed && f->lined_up) PetscCall(begin_anew(f, c));
  f->lined_up = PETSC_TRUE;
  PetscCall(PetscFree(volume));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsNameCells(CoupleDrops *f, Couple c)
{
  PetscInt      *part, n, *number;
  PhaseInterface now;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->loc->ncell_all, &part));
  PetscCall(DropsFindParts(c, f->result.cell_surface, part, &n));
  PetscCall(DropsGather(f, c, part, NULL, &now));
  PetscCall(PetscMalloc1(n, &number));
  PetscCall(DropsName(f, c, n, &now, number));
  for (PetscInt e = 0; e < c->loc->ncell_all; e++) f->cell_drop[e] = part[e] < 0 ? -1 : number[part[e]];
  PetscCall(PetscFree(number));
  PetscCall(PhaseInterfaceDestroy(&now));
  PetscCall(PetscFree(part));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsLineUp(CoupleDrops *f, Couple c)
{
  const PetscBool wanted[1]  = {PETSC_TRUE};
  PetscBool       aligned[1] = {PETSC_FALSE};

  PetscFunctionBeginUser;
  if (c->loc->dim == 3 && !PhaseInterfaceSize(&f->interface)) PetscCall(PhaseSurfacesSetStart(f->surfaces, f->drops));
  else PetscCall(PhaseSurfacesSet(f->surfaces, &f->interface));
  PetscCall(AlignFit(f->align, wanted, NULL, aligned, &f->result));
  PetscCheck(!f->result.npass, c->comm, PETSC_ERR_SUP,
             "A drop reaches beyond a side of the domain at t = %g: move it (-particle_<group>_position), or the side (-mesh_upper, -mesh_lower), or have it wet walls "
             "of type slip (-particle_<group>_contact_angle)",
             (double)c->step->time);
  if (!aligned[0]) PetscCall(DropsStop(f, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsAlign(CoupleDrops *f, Couple c)
{
  const AlignResult *r = &f->result;
  PetscInt           n = 0, *node = NULL;
  PetscReal         *value = NULL;

  PetscFunctionBeginUser;
  PetscCall(DropsLineUp(f, c));
  PetscCall(MeshUpdateBegin(c->mesh_update, r->ncell, r->cell, NULL));
  PetscCall(DropsCarry(f, c, &n, &node, &value));
  PetscCall(MeshUpdateCommit(c->mesh_update, &(MeshUpdateMesh){.nnode    = r->nnode,
                                                               .node     = r->node,
                                                               .x        = r->x,
                                                               .ncarried = n,
                                                               .carried  = node,
                                                               .value    = value}));
  PetscCall(PetscFree2(node, value));
  ConstraintMoveNodes(c->constraint);
  PetscCall(DropsNameCells(f, c));
  PetscCall(DropsSetProperties(f, c));
  PetscCall(FlowSetMeshVelocity(c->flow, f->velocity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsPlaceNodes(CoupleDrops *f, Couple c)
{
  const AlignResult *r = &f->result;

  PetscFunctionBeginUser;
  PetscCall(MeshUpdateRestore(c->mesh_update, r->ncell, r->cell,
                              &(MeshUpdateMesh){.nnode = r->nnode, .node = r->node, .x = r->x}));
  PetscFunctionReturn(PETSC_SUCCESS);
}
