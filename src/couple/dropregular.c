/* CoupleDrops, regularised (-couple_drops regularised): no mesh is lined up, cells may have both fluids in them.
   Density and viscosity of a cell are means of a step that is smeared over a band of 1.5 cells on either side; the
   surface tension is the Laplace-Beltrami form in that band,

     -sigma int delta(d) (P grad x, P grad v),  P = I - n n,  d and n distance and normal of the interface,

   implicit in what the step adds, as on edges (drops.h). Old velocities are those at the feet of trajectories, as
   there. The interface is a curve by itself, whose nodes move with the flow where they are (dropcurve.c); then it is
   drawn anew as the zero line of its distance on a lattice of half a cell, which is what merges and breaks it. Of drops
   that meet across a period one is taken over to the other before.

   Nothing has to be lined up, so that nothing cannot: films and necks may be as thin as the lattice. The price is in
   runs/studies/drops/notes.md ("Regularised"). Brackbill, Kothe & Zemach 1992 for the smearing. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/array.h"
#include "base/log.h"
#include "fem/edge.h"
#include "fem/element.h"
#include "fem/gauss.h"

#define WIDTH   1.5 /* cells: half the width of the band */
#define LATTICE 0.5 /* cells */
#define CELL    1.5 /* cells: no point of a cell is farther from its middle */
#define NPOINT  16

PetscErrorCode DropsCheckRegular(CoupleDrops *f, Couple c)
{
  const char *what = NULL;

  PetscFunctionBeginUser;
  if (c->loc->dim == 3) what = "drops in space";
  else if (c->s->nall) what = "rigid bodies beside drops";
  else if (c->loc->hang) what = "cells of several sizes";
  else if (c->scalars) what = "scalars (-scalars)";
  else if (DropsMayStayApart(f->s)) what = "drops that stay apart (_coalescence, _film, _drainage)";
  else if (DropsWet(f->s)) what = "walls that drops wet (_contact_angle)";
  PetscCheck(!what, c->comm, PETSC_ERR_SUP, "-couple_drops regularised has no %s: give -couple_drops aligned", what);
  PetscCall(LogRemark(
    "-couple_drops regularised: a bubble of 10 cells across is within 1 %% in shape and speed, but nothing comes to rest: where tension rules, currents of "
    ".02 to 3 %% of tension over viscosity stay, the more the lighter a drop is, with any cells (-couple_drops aligned: 1e-6)"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the step ---- */

/* Old velocities near the interface are those at the feet of trajectories, as where a mesh is lined up (drops.h) */
static PetscErrorCode take_feet(CoupleDrops *f, Couple c)
{
  const PetscInt dim = c->loc->dim;
  PetscInt       n, *node;
  PetscReal     *value, *u[2];

  PetscFunctionBeginUser;
  PetscCall(PhaseSurfacesSet(f->surfaces, &f->interface));
  PetscCall(DropsCarry(f, c, &n, &node, &value));
  PetscCall(FlowGetFields(c->flow, &u[0], &u[1], NULL));
  for (PetscInt k = 0; k < 2; k++) {
    for (PetscInt e = 0; e < n; e++) PetscCall(PetscArraycpy(u[k] + dim * node[e], value + dim * (2 * e + k), dim));
    PetscCall(MeshSyncNodes(c->mesh, dim, u[k]));
  }
  PetscCall(PetscFree2(node, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void move_drop(PhaseCurve *curve, PetscInt drop, const PetscReal by[])
{
  for (PetscInt i = 0; i < 6 * curve->n; i++)
    if (curve->drop[i / 6] == drop) curve->x[i / 6][i / 2 % 3][i % 2] += by[i % 2];
  PhaseCurveUpdate(curve);
}

/* Centres of drops are in the domain; but drops nearer than `reach` to an image of another go over to it, since what
   draws the curve anew knows no images */
static PetscErrorCode bring_together(CoupleDrops *f, Couple c, PetscReal reach)
{
  const MeshLocal *l     = c->loc;
  PhaseCurve      *curve = &f->interface.curve;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < f->s->n; k++) {
    PhaseSums sums;
    PetscReal by[2];

    PhaseCurveMeasure(curve, f->s->drop[k].number, &sums);
    for (PetscInt a = 0; a < 2; a++) by[a] = DomainWrap(l->period[a], sums.centre[a], l->lower[a]) - sums.centre[a];
    if (by[0] != 0 || by[1] != 0) move_drop(curve, f->s->drop[k].number, by);
  }
  for (PetscInt e = 0; e < curve->n; e++) {
    const PetscReal place[3] = {curve->x[e][1][0], curve->x[e][1][1], 0};

    for (DomainImages i = {0}; MeshNextImage(l, place, PETSC_MAX_REAL / 4, &i);) {
      PhasePoint p;

      if (i.shift[0] == 0 && i.shift[1] == 0) continue;
      PhaseCurveClosest(curve, i.at, reach, &p);
      if (p.edge < 0) continue;
      PetscCheck(curve->drop[p.edge] != curve->drop[e], c->comm, PETSC_ERR_SUP,
                 "Drop %" PetscInt_FMT
                 " has met itself across a period at t = %g, near (%g, %g), of which -couple_drops regularised can make no layer: give "
                 "-couple_drops aligned, or a longer period (-mesh_lower, -mesh_upper)",
                 curve->drop[e], (double)c->step->time, (double)place[0], (double)place[1]);
      move_drop(curve, curve->drop[e], i.shift);
      break;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsRegularise(CoupleDrops *f, Couple c)
{
  const PetscReal step = LATTICE * c->loc->h;
  PhaseInterface  now  = {0};
  PetscInt        n, *number;

  PetscFunctionBeginUser;
  PetscCall(bring_together(f, c, step));
  PetscCall(take_feet(f, c));
  /* nodes and middles of cells, on which a scene may have placed the interface, are on no line */
  PetscCall(PhaseCurveRetrace(&f->interface.curve,
                              (PetscReal[2]){c->loc->lower[0] + 0.5 * step, c->loc->lower[1] + 0.5 * step}, step,
                              &now.curve, &n));
  PetscCall(PetscMalloc1(n, &number));
  PetscCall(DropsName(f, c, n, &now, number));
  for (PetscInt e = 0; e < now.curve.n; e++) now.curve.drop[e] = number[now.curve.drop[e]];
  PetscCall(PhaseInterfaceDestroy(&f->interface));
  f->interface = now;
  PetscCall(DropsFindFractions(f, c));
  PetscCall(DropsSetProperties(f, c));
  PetscCall(FlowSetMeshVelocity(c->flow, f->velocity));
  PetscCall(PetscFree(number));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells ---- */

/* The nearest of the curve's images: its distance, the normal of length 1 away from it, the number of its drop */
static PetscReal distance_at(const CoupleDrops *f, const MeshLocal *l, const PetscReal x[2], PetscReal n[2],
                             PetscInt *drop)
{
  const PhaseCurve *curve = &f->interface.curve;
  PhasePoint        p;

  DropsNearest(&f->interface, l, x, PETSC_MAX_REAL / 4, &p);
  if (p.edge < 0) return p.d;
  for (PetscInt a = 0; a < 2; a++) n[a] = (x[a] - p.y[a]) / PetscAbsReal(p.d);
  if (PetscAbsReal(p.d) < 1e-6 * l->h) EdgeNormal(curve->x[p.edge], EdgeClosest(curve->x[p.edge], p.y), n);
  *drop = curve->drop[p.edge];
  return p.d;
}

/* Part of the inside at a distance, and its derivative without the sign */
static PetscReal step_at(PetscReal d, PetscReal width)
{
  const PetscReal s = PetscMax(-1, PetscMin(1, d / width));

  return 0.5 * (1 - s - PetscSinReal(PETSC_PI * s) / PETSC_PI);
}

static PetscReal delta_at(PetscReal d, PetscReal width)
{
  return PetscAbsReal(d) < width ? 0.5 * (1 + PetscCosReal(PETSC_PI * d / width)) / width : 0;
}

/* K [nb][nb] = int delta (P grad phi_i) . (P grad phi_j) over a cell with nodes xc; the mean of the step in it */
static PetscReal integrate_cell(const CoupleDrops *f, const MeshLocal *l, const PetscReal xc[], PetscReal K[])
{
  const PetscReal width = WIDTH * l->h;
  PetscReal       area = 0, inside = 0;

  for (PetscInt i = 0; i < l->nb * l->nb; i++) K[i] = 0;
  for (PetscInt q = 0; q < NPOINT; q++) {
    const PetscReal xi[2] = {GAUSS4_POINT[q % 4], GAUSS4_POINT[q / 4]};
    PetscReal       phi[MESH_MAX_NB], dphi[2 * MESH_MAX_NB], x[2], J[4], inverse[4], n[2], w, d, along[MESH_MAX_NB];
    PetscInt        drop;

    ElementBasis(2, xi, phi, dphi);
    ElementMap(2, xc, xi, x, J);
    w = GAUSS4_WEIGHT[q % 4] * GAUSS4_WEIGHT[q / 4] * DenseInvertMap(2, J, inverse);
    d = distance_at(f, l, x, n, &drop);
    area += w;
    inside += w * step_at(d, width);
    w *= delta_at(d, width);
    if (w == 0) continue;
    for (PetscInt j = 0; j < l->nb; j++) {
      along[j] = 0;
      for (PetscInt e = 0; e < 2; e++)
        along[j] += dphi[l->nb * e + j] * (n[0] * inverse[2 * e + 1] - n[1] * inverse[2 * e]);
    }
    for (PetscInt i = 0; i < l->nb * l->nb; i++) K[i] += w * along[i / l->nb] * along[i % l->nb];
  }
  return inside / area;
}

PetscErrorCode DropsFindFractions(CoupleDrops *f, Couple c)
{
  const MeshLocal *l  = c->loc;
  const PetscInt   nb = l->nb;

  PetscFunctionBeginUser;
  f->nband = 0;
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    PetscReal xc[2 * MESH_MAX_NB], n[2], d;
    PetscInt  drop = -1;

    PetscCall(MeshCellCoordinates(c->mesh, e, xc));
    d               = distance_at(f, l, xc + 2 * (nb / 2), n, &drop);
    f->by_middle[e] = d < 0 ? drop : -1;
    f->cell_drop[e] = f->by_middle[e];
    f->fraction[e]  = d < 0 ? 1 : 0;
    if (PetscAbsReal(d) >= (WIDTH + CELL) * l->h) continue;
    PetscCall(ArrayReserve(f->nband + 1, &f->band_capacity, &f->band_cell, sizeof(*f->band_cell), &f->band,
                           nb * nb * sizeof(*f->band), NULL));
    f->fraction[e]  = integrate_cell(f, l, xc, f->band + nb * nb * f->nband);
    f->cell_drop[e] = f->fraction[e] > 0 ? drop : -1;
    if (f->fraction[e] > 0 && f->fraction[e] < 1) f->band_cell[f->nband++] = e;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
