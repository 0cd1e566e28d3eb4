/* Drops, inherit: who descends from whom when the interface is found on a new mesh (phase/drops.h). An edge (face) of
   the new interface comes from the drop whose old one is nearest to its middle. Drops and parts that these tie together
   are one event: nothing as a rule, else drops that merged, or one that broke up. */
#include "compat.h"
#include "impl.h"

typedef struct {
  PetscInt  nold, nparts;
  PetscInt *up;    /* [nold + nparts] union and find */
  PetscInt *vote;  /* [nparts][nold] edges of a part that come from a drop */
  PetscInt *order; /* [nparts] largest first */
} Descent;

static PetscInt root_of(const Descent *d, PetscInt i)
{
  while (d->up[i] != i) i = d->up[i];
  return i;
}

/* The number of the drop whose interface is nearest to x */
static PetscErrorCode find_nearest(Drops b, const PhaseInterface *from, const PetscReal x[], PetscInt *number)
{
  const PetscReal *middle;
  PhasePoint       p;

  PetscFunctionBeginUser;
  *number = -1;
  if (!PhaseInterfaceSize(from)) {
    PetscCall(DropsStartNearest(b, x, number, &p.d));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PhaseInterfaceClosest(from, x, PETSC_MAX_REAL / 4, &p);
  if (p.edge >= 0) (void)PhaseInterfacePiece(from, p.edge, number, &middle);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode count_votes(Drops b, const PhaseInterface *from, const PhaseInterface *now, Descent *d)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < d->nold + d->nparts; i++) d->up[i] = i;
  for (PetscInt e = 0; e < PhaseInterfaceSize(now); e++) {
    const PetscReal *middle;
    PetscInt         part, number, old;

    if (!PhaseInterfacePiece(now, e, &part, &middle)) continue;
    PetscCall(find_nearest(b, from, middle, &number));
    old = DropsFind(&b->s, number);
    if (old < 0) continue;
    d->vote[part * d->nold + old]++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of those that a part's votes name: all, but for drops that stay apart from the one that most name */
static void unite(const DropsState *s, Descent *d)
{
  for (PetscInt part = 0; part < d->nparts; part++) {
    const PetscInt *vote = d->vote + part * d->nold;
    PetscInt        most = 0;

    for (PetscInt o = 1; o < d->nold; o++)
      if (vote[o] > vote[most]) most = o;
    for (PetscInt o = 0; o < d->nold; o++)
      if (vote[o] && !DropsAreApart(s, s->drop[most].number, s->drop[o].number))
        d->up[root_of(d, d->nold + part)] = root_of(d, o);
  }
}

static void sort_by_volume(const PetscReal volume[], Descent *d)
{
  for (PetscInt i = 0; i < d->nparts; i++) {
    PetscInt at = i;

    for (; at > 0 && volume[d->order[at - 1]] < volume[i]; at--) d->order[at] = d->order[at - 1];
    d->order[at] = i;
  }
}

/* The drop of its event that most edges of the part come from and that no part is yet, -1: none is left */
static PetscInt choose_old(const Descent *d, PetscInt part, const PetscBool taken[])
{
  PetscInt best = -1;

  for (PetscInt o = 0; o < d->nold; o++) {
    if (taken[o] || root_of(d, o) != root_of(d, d->nold + part)) continue;
    if (best < 0 || d->vote[part * d->nold + o] > d->vote[part * d->nold + best]) best = o;
  }
  return best;
}

static PetscBool same_fluid(const DropGroup *g, const DropGroup *h)
{
  return (PetscBool)(g->density == h->density && g->viscosity == h->viscosity && g->tension == h->tension &&
                     g->carries == h->carries);
}

/* Target and group of what becomes of an event, for a share of its volume */
static PetscErrorCode share_targets(Drops b, const Descent *d, PetscInt part, const PetscReal volume[], Drop *drop)
{
  const DropsState *s   = &b->s;
  const PetscInt    own = root_of(d, d->nold + part);
  PetscReal         sum = 0, all = 0;

  PetscFunctionBeginUser;
  drop->group = -1;
  for (PetscInt o = 0; o < d->nold; o++) {
    if (root_of(d, o) != own) continue;
    PetscCheck(drop->group < 0 || same_fluid(&b->group[drop->group], &b->group[s->drop[o].group]), b->comm,
               PETSC_ERR_SUP,
               "Drops of the groups '%s' and '%s' have met, and different fluids do not merge: keep them apart, or give them the same density, viscosity, surface tension and -particle_<group>_<scalar>_ materials (-particle_<group>_coalescence never)",
               b->group[PetscMax(0, drop->group)].name, b->group[s->drop[o].group].name);
    if (drop->group < 0) drop->group = s->drop[o].group;
    sum += s->drop[o].target;
  }
  for (PetscInt p = 0; p < d->nparts; p++)
    if (root_of(d, d->nold + p) == own) all += volume[p];
  drop->target = all > 0 ? sum * volume[part] / all : volume[part];
  if (drop->group < 0) drop->group = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Energy of the interfaces of an event before it, less after it */
static PetscReal energy_taken(const DropsState *s, const Descent *d, PetscInt event, const PhaseInterface *from,
                              const PhaseInterface *now)
{
  const DropGroup *g   = s->group;
  PetscReal        sum = 0;
  PhaseSums        of;

  for (PetscInt i = 0; i < d->nold + d->nparts; i++) {
    if (root_of(d, i) != event) continue;
    if (i < d->nold) g = s->group + s->drop[i].group;
    if (i >= d->nold) PhaseInterfaceMeasure(now, i - d->nold, &of);
    else if (s->drop[i].leaves) of = s->drop[i].sums;
    else PhaseInterfaceMeasure(from, s->drop[i].number, &of);
    sum += (i < d->nold ? 1 : -1) * DropSurfaceEnergy(g, &of);
  }
  return sum;
}

/* Events are counted, what vanished, and what they take */
static PetscBool count_events(DropsState *s, const PhaseInterface *from, const PhaseInterface *now, const Descent *d)
{
  PetscBool changed = PETSC_FALSE;

  for (PetscInt i = 0; i < d->nold + d->nparts; i++) {
    PetscInt olds = 0, parts = 0;

    if (d->up[i] != i) continue;
    for (PetscInt j = 0; j < d->nold + d->nparts; j++)
      if (root_of(d, j) == i) *(j < d->nold ? &olds : &parts) += 1;
    if (olds == 1 && parts == 1) continue;
    changed = PETSC_TRUE;
    s->taken += energy_taken(s, d, i, from, now);
    if (!parts && s->drop[i].leaves) {
      s->left++;
      s->left_volume += s->drop[i].target;
    } else if (!parts) {
      s->lost += s->drop[i].target;
      s->vanished = s->drop[i].group;
    } else {
      s->merged += PetscMax(0, olds - 1);
      s->broken += parts - 1;
    }
  }
  return changed;
}

static int by_number(const void *a, const void *b)
{
  return (((const Drop *)a)->number > ((const Drop *)b)->number) -
         (((const Drop *)a)->number < ((const Drop *)b)->number);
}

PetscErrorCode DropsInherit(Drops b, const PhaseInterface *from, const PhaseInterface *now, PetscInt parts,
                            const PetscReal volume[], PetscInt number[], PetscBool *changed)
{
  DropsState *s = &b->s;
  Descent     d = {.nold = s->n, .nparts = parts};
  PetscBool  *taken;
  Drop       *drop;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(s->n + parts, &d.up, parts, &d.order));
  PetscCall(PetscCalloc2(parts * s->n, &d.vote, s->n, &taken));
  PetscCall(PetscCalloc1(parts, &drop));
  PetscCall(count_votes(b, from, now, &d));
  unite(s, &d);
  sort_by_volume(volume, &d);
  *changed = count_events(s, from, now, &d);
  for (PetscInt i = 0; i < parts; i++) {
    const PetscInt part = d.order[i], old = choose_old(&d, part, taken);

    if (old >= 0) taken[old] = PETSC_TRUE;
    if (old >= 0) drop[i] = s->drop[old];
    PetscCall(share_targets(b, &d, part, volume, &drop[i]));
    drop[i].number = old >= 0 ? s->drop[old].number : s->numbers++;
    number[part]   = drop[i].number;
  }
  qsort(drop, (size_t)parts, sizeof(*drop), by_number);
  PetscCall(PetscFree(s->drop));
  s->drop = drop;
  s->n    = parts;
  PetscCall(PetscFree2(d.up, d.order));
  PetscCall(PetscFree2(d.vote, taken));
  PetscFunctionReturn(PETSC_SUCCESS);
}
