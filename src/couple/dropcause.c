/* CoupleDrops, causes: why the mesh cannot follow an interface, and what of drops is not as given at the start. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/log.h"
#include "fem/edge.h"

#define NEAR  2.0  /* cells around the place that are looked at */
#define FAST  0.7  /* such a way is said to be the cause */
#define WRONG 0.25 /* of its volume: a drop that is more off stops the run, */
#define TINY  4    /* cells: but for those that are no larger */
#define OTHER 0.02 /* of its volume: a drop that differs by more has as its target what it has */

typedef struct {
  PetscReal x[3], h;
  PetscReal way;    /* largest way of the interface in the step, cells; likewise: */
  PetscReal narrow; /* least distance to a part of the interface that faces it, film or neck */
  PetscReal wall;   /* least distance to a side of the domain, */
  PetscInt  side;   /* which is that one: 2 axis + (upper one), */
  PetscReal at[3];  /* and what is nearest to it */
  PetscReal bend;   /* least radius of curvature, by the ends of an edge */
} Cause;

static PetscBool is_near(const MeshLocal *l, const Cause *w, const PetscReal x[])
{
  PetscReal square = 0;

  for (PetscInt a = 0; a < l->dim; a++) square += PetscSqr(x[a] - w->x[a]);
  return (PetscBool)(square < PetscSqr(NEAR * w->h));
}

static void look_at_edge(const PhaseCurve *curve, PetscInt e, Cause *w)
{
  const PetscReal *first = curve->x[e][0], *middle = curve->x[e][1], *last = curve->x[e][2];
  const PetscReal  chord[2] = {last[0] - first[0], last[1] - first[1]}, size = PetscHypotReal(chord[0], chord[1]);
  PetscReal        sag;

  if (size == 0) return;
  for (PetscInt side = -1; side <= 1; side += 2) { /* what faces it inside and outside */
    const PetscReal out[2] = {-chord[1], chord[0]};
    PhasePoint      p;

    for (PetscInt a = 0; a < 2; a++) p.y[a] = middle[a] + 0.01 * w->h * (PetscReal)side * out[a] / size;
    PhaseCurveApproach(curve, p.y, out, &p);
    if (p.edge >= 0 && p.edge != curve->next[e] && p.edge != curve->before[e])
      w->narrow = PetscMin(w->narrow, p.d / w->h);
  }
  sag = PetscAbsReal((middle[0] - first[0]) * chord[1] - (middle[1] - first[1]) * chord[0]) / size;
  if (sag > 0) w->bend = PetscMin(w->bend, size * size / (8 * sag) / w->h);
}

/* Edges or faces of one drop, or (drop < 0) near the place */
static void look_around(const MeshLocal *l, const PhaseInterface *f, PetscInt drop, Cause *w)
{
  for (PetscInt e = 0; e < PhaseInterfaceSize(f); e++) {
    const PetscReal *middle;
    PetscInt         of;

    if (!PhaseInterfacePiece(f, e, &of, &middle) || (drop < 0 ? !is_near(l, w, middle) : of != drop)) continue;
    if (l->dim == 2) look_at_edge(&f->curve, e, w);
    for (PetscInt side = 0; side < 2 * l->dim; side++) {
      const PetscInt  a   = side / 2;
      const PetscReal gap = (side % 2 ? l->upper[a] - middle[a] : middle[a] - l->lower[a]) / w->h;

      if (l->period[a] > 0 || gap >= w->wall) continue;
      w->wall = gap;
      w->side = side;
      for (PetscInt b = 0; b < l->dim; b++) w->at[b] = middle[b];
    }
  }
}

/* What is worst; opening: the nearest side is, NULL: it is a wall; out: fluid goes out there */
static void describe(const Cause *w, const char opening[], PetscBool out, char text[], size_t len)
{
  if (w->wall < 1.5 && opening && !out)
    (void)
      snprintf(text, len,
               "it is at the inflow '%s', through which none leaves: move it (-particle_<group>_position), or the inflow "
               "(-mesh_lower, -mesh_upper), farther away",
               opening);
  else if (w->wall < 1.5 && opening)
    (void)
      snprintf(text, len,
               "it has come to the opening '%s' and is not one that could leave there (none can in space, or with -scalars): end the run before that (-sim_time), or move the opening "
               "farther away (-mesh_lower, -mesh_upper)",
               opening);
  else if (w->way > FAST)
    (void)snprintf(text, len, "the interface goes %.2g cells in a step: lower -sim_dt", (double)w->way);
  else if (w->wall < 1.5)
    (void)
      snprintf(text, len,
               "the interface is %.2g cells from a side of the domain, where a film of the fluid around stays: keep drops away from sides that "
               "they do not wet, or use smaller cells (-mesh_cells)",
               (double)PetscMax(0, w->wall));
  else if (w->narrow < 1)
    (void)snprintf(text, len, "there is a film or a neck of %.2g cells: use smaller cells (-mesh_cells)",
                   (double)w->narrow);
  else if (w->bend < 99)
    (void)snprintf(text, len, "the interface has a radius of curvature of %.2g cells: use smaller cells (-mesh_cells)",
                   (double)w->bend);
  else (void)snprintf(text, len, "use smaller cells (-mesh_cells), or a smaller -sim_dt");
}

/* Farthest that a node of the drop goes, or (drop < 0) one near the place; of all ranks. Collective. */
static PetscErrorCode find_way(const CoupleDrops *f, Couple c, PetscInt drop, Cause *w)
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell * l->nb; e++) {
    const PetscInt i      = l->cell_node[e];
    PetscReal      square = 0;

    if (drop < 0 ? !is_near(l, w, l->x + l->dim * i) : f->cell_drop[e / l->nb] != drop) continue;
    for (PetscInt a = 0; a < l->dim; a++) square += PetscSqr(f->way[l->dim * i + a]);
    w->way = PetscMax(w->way, PetscSqrtReal(square) / w->h);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &w->way, 1, MPIU_REAL, MPIU_MAX, c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of a drop, or (drop < 0) near x. Collective. */
static PetscErrorCode explain(const CoupleDrops *f, Couple c, const PhaseInterface *interface, PetscInt drop,
                              const PetscReal x[3], char text[], size_t len)
{
  Cause       w = {.x = {x[0], x[1], x[2]}, .h = c->loc->h, .narrow = 99, .wall = 99, .bend = 99};
  const char *opening;
  PetscBool   out;

  PetscFunctionBeginUser;
  look_around(c->loc, interface, drop, &w);
  PetscCall(find_way(f, c, drop, &w));
  PetscCall(DropsFindOpening(c, w.side, w.at, &opening, &out));
  describe(&w, opening, out, text, len);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStop(CoupleDrops *f, Couple c)
{
  const PetscReal *x = f->result.flat;
  char             why[256];

  PetscFunctionBeginUser;
  PetscCall(explain(f, c, &f->interface, -1, x, why, sizeof(why)));
  SETERRQ(c->comm, PETSC_ERR_USER_INPUT, "The mesh cannot be lined up with the drops at t = %g near (%g, %g, %g): %s",
          (double)c->step->time, (double)x[0], (double)x[1], (double)(c->loc->dim == 3 ? x[2] : 0), why);
}

PetscErrorCode DropsCheckVolumes(CoupleDrops *f, Couple c)
{
  const DropsState *s = f->s;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const Drop     *d     = s->drop + k;
    const PetscReal error = d->sums.area / d->target - 1;
    char            why[256];

    if (PetscAbsReal(error) <= WRONG || d->target <= TINY * PetscPowRealInt(c->loc->h, (int)c->loc->dim)) continue;
    PetscCall(explain(f, c, &s->interface, d->number, d->sums.centre, why, sizeof(why)));
    SETERRQ(c->comm, PETSC_ERR_USER_INPUT,
            "The volume of drop %" PetscInt_FMT " ('%s') is off by %.2g %% at t = %g, centre (%g, %g, %g): %s",
            d->number, s->group[d->group].name, (double)(100 * error), (double)c->step->time, (double)d->sums.centre[0],
            (double)d->sums.centre[1], (double)d->sums.centre[2], why);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsCheckStart(CoupleDrops *f, Couple c, PetscInt parts, const PetscReal volume[],
                               const PetscInt number[])
{
  DropsState *s = f->s;

  PetscFunctionBeginUser;
  PetscCheck(s->vanished < 0, c->comm, PETSC_ERR_USER_INPUT,
             "The mesh has no cell for the fluid '%s': its middle would have to lie in it, a cell away from walls and bodies that are not wetted, and good "
             "numbers need two cells a radius: use smaller cells (-mesh_cells), or move it (-particle_%s_position)",
             s->group[s->vanished].name, s->group[s->vanished].name);
  if (s->merged)
    PetscCall(LogRemark("drops overlap at the start, or have less than a cell between them: %" PetscInt_FMT
                        " start as one with another",
                        s->merged));
  for (PetscInt i = 0; i < parts; i++) {
    Drop           *d     = s->drop + DropsFind(s, number[i]);
    const PetscReal error = d->target > 0 ? volume[i] / d->target - 1 : 0;

    if (d->target == 0) d->target = volume[i]; /* a region in space has what the mesh has of it */
    if (PetscAbsReal(error) <= OTHER) continue;
    PetscCall(
      LogRemark("drop %" PetscInt_FMT
                " ('%s') starts with a volume of %.4g, %.2g %% from that of its shape: it overlaps another, lies within a cell of a "
                "wall or body that it does not wet, or has few cells a radius",
                d->number, s->group[d->group].name, (double)volume[i], (double)(100 * error)));
    d->target = volume[i];
  }
  s->merged = s->broken = 0;
  s->taken              = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
