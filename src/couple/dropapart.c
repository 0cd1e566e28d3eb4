/* CoupleDrops, apart: drops that are not to merge, or not yet (-particle_<group>_coalescence, _film, _drainage). Where
   cells of two such drops would meet at a vertex, the one that is least inside goes back to the fluid around, as beside
   walls that are not wetted: a cell of it stays between them, whose nodes may be off the interface. */
#include "compat.h"
#include "drops.h"
#include "impl.h"

#define TIE   1e-9 /* of a cell: as align/cover.c */
#define THICK 2.0  /* cells: films are no thicker when they break */

typedef struct {
  PetscReal *number, *depth, *mark; /* [nnode_all] at middles of cells: the drop that it is in, -1; signed distance */
} Labels;

/* The drops that hold the middles of cells */
static PetscErrorCode label_cells(const CoupleDrops *f, Couple c, Labels *t)
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) t->number[i] = -1;
  for (PetscInt e = 0; e < l->ncell; e++) {
    const PetscInt i = l->cell_node[e * l->nb + l->nb / 2];
    PetscInt       drop;

    if (f->closed[e]) continue;
    PetscCall(DropsFindDeepest(f, l, l->x_start + l->dim * i, &drop, &t->depth[i]));
    t->number[i] = t->depth[i] < -TIE * l->h ? (PetscReal)drop : -1;
  }
  PetscCall(MeshSyncNodes(c->mesh, 1, t->number));
  PetscCall(MeshSyncNodes(c->mesh, 1, t->depth));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the cells around own vertex i: if two of them are of drops that stay apart, the one least inside is marked */
static PetscBool mark_around(const CoupleDrops *f, const MeshLocal *l, PetscInt i, Labels *t)
{
  PetscInt  first = -1, worst = -1;
  PetscBool any = PETSC_FALSE;

  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
    const PetscInt middle = l->cell_node[l->node_cell[q] * l->nb + l->nb / 2], number = (PetscInt)t->number[middle];

    if (number < 0) continue;
    if (first >= 0 && first != number && DropsAreApart(f->s, first, number)) any = PETSC_TRUE;
    if (first < 0) first = number;
    if (worst < 0 || t->depth[middle] > t->depth[worst] ||
        (t->depth[middle] == t->depth[worst] &&
         l->cell_global[l->centre_cell[middle]] > l->cell_global[l->centre_cell[worst]]))
      worst = middle;
  }
  if (any) t->mark[worst] = 1;
  return any;
}

static PetscErrorCode open_cells(CoupleDrops *f, Couple c, Labels *t, PetscBool *any)
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  for (PetscInt e = 0; e < l->ncell_all; e++)
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i = l->cell_node[e * l->nb + j];

      if (j % 3 % 2 || j / 3 % 3 % 2 || j / 9 % 2 || i >= l->nnode) continue; /* vertices */
      if (mark_around(f, l, i, t)) *any = PETSC_TRUE;
    }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, c->comm));
  if (!*any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MeshSumNodes(c->mesh, 1, t->mark));
  PetscCall(MeshSyncNodes(c->mesh, 1, t->mark));
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    const PetscInt i = l->cell_node[e * l->nb + l->nb / 2];

    if (t->mark[i] > 0 && e < l->ncell) f->closed[e] = PETSC_TRUE;
    if (t->mark[i] > 0) t->number[i] = -1;
    t->mark[i] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nor become drops' the cells of the fluid around that touch two drops that stay apart, when the mesh is mended
   (align/repair.c) */
static void close_between(CoupleDrops *f, const MeshLocal *l, const Labels *t)
{
  for (PetscInt e = 0; e < l->ncell; e++) {
    PetscInt first = -1;

    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i = l->cell_node[e * l->nb + j];

      for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
        const PetscInt number = (PetscInt)t->number[l->cell_node[l->node_cell[q] * l->nb + l->nb / 2]];

        if (DropsAreApart(f->s, first, number)) f->closed[e] = PETSC_TRUE;
        if (first < 0) first = number;
      }
    }
  }
}

PetscErrorCode DropsSetFilm(CoupleDrops *f, Couple c)
{
  const DropsState *s     = f->s;
  PetscReal         film  = 0;
  PetscBool         never = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const DropGroup *group = s->group + g;

    PetscCheck(group->film <= THICK * c->loc->h, c->comm, PETSC_ERR_USER_INPUT,
               "-particle_%s_film %g is more than %g cells of %g, across which a mesh cannot join drops: lower it, or use larger cells (-mesh_cells)",
               group->name, (double)group->film, THICK, (double)c->loc->h);
    PetscCheck(c->loc->dim == 2 || (group->film == 0 && group->drainage == 0), c->comm, PETSC_ERR_SUP,
               "-particle_%s_film and _drainage are for the plane so far: remove them", group->name);
    film  = PetscMax(film, group->film);
    never = (PetscBool)(never || group->never);
  }
  if (film > c->loc->h && !never) PetscCall(PhaseSurfacesSetFilm(f->surfaces, film));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsKeepApart(CoupleDrops *f, Couple c)
{
  Labels    t;
  PetscBool any = PETSC_TRUE;

  PetscFunctionBeginUser;
  if (!DropsMayStayApart(f->s)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DropsFindPairs(f->drops, &f->interface, c->loc->h, c->step->time, c->loc->period));
  PetscCall(PetscCalloc3(c->loc->nnode_all, &t.number, c->loc->nnode_all, &t.depth, c->loc->nnode_all, &t.mark));
  PetscCall(label_cells(f, c, &t));
  while (any) PetscCall(open_cells(f, c, &t, &any));
  close_between(f, c->loc, &t);
  PetscCall(PetscFree3(t.number, t.depth, t.mark));
  PetscFunctionReturn(PETSC_SUCCESS);
}
