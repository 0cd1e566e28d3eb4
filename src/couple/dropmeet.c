/* CoupleDrops, bodies that drops wet: interfaces end on rigid bodies with a contact angle, which the penalty holds. The
   interface goes on inside of the body, where the mesh is lined up with it too, and moves rigidly; there, and a cell
   around, it is drawn anew in every step, such that it meets the surface at the contact angle (phase/meet.c, in space
   phase/sheetmeet.c). So the contact line goes to where the angle wants it, over a slip length of about a cell. The
   first mesh has it as the start says: what of a drop is outside of bodies is known before the interface is drawn. The
   body feels the tension of the interface at its inner end, which is Young's force, in the rows of its motion like
   every force on its nodes.

   The fluid in a body has the density that the rows of bodies reckon with, that of the fluid around, so that the
   density of cells that the surface cuts is between that and the drop's. Gravity pulls at it as at the fluid that it
   takes the place of, and the body gives that back: else cells side by side have other pressures at rest, and fluid
   creeps around the body. The volume that a drop keeps is the one outside of bodies. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "penalty.h"
#include "base/opt.h"
#include "base/sparse.h"
#include "base/algebra.h"
#include "base/face.h"
#include "bodies/local.h"
#include "bodies/mass.h"
#include "fem/edge.h"
#include "fem/element.h"
#include "flow/condition.h"

#define PIECES 12  /* of an edge or along both directions of a face, where the surface of a body cuts it */
#define ACROSS 0.9 /* of its radius: a body whose centre is nearer to a wall lies across it */
#define POINTS 600 /* of a body's surface, in space ten times as many */

/* As the owner of a body tells all ranks, numbers as reals */
typedef struct {
  PetscReal group, scale, X[3], q[4];
} Wetted;

typedef struct {
  Couple             c;
  const CoupleDrops *f;
  PetscInt           n;
  Wetted            *body;
} WettedBodies;

PetscErrorCode DropsReadAngles(CoupleDrops *f, Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->s->ngroups, &f->angle));
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    char name[OPT_NAME];

    PetscCall(OptReal(OptJoin("-particle_", c->s->group[g].name, "_contact_angle", name), &f->angle[g]));
    if (f->angle[g] > 0 && c->s->group[g].count) f->meets = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode distance(void *ctx, PetscInt n, const PetscReal x[], PetscReal d[], PetscReal angle[])
{
  const WettedBodies *s = (const WettedBodies *)ctx;
  const MeshLocal    *l = s->c->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    d[i] = PETSC_MAX_REAL;
    for (PetscInt k = 0; k < s->n; k++) {
      const Wetted  *b     = s->body + k;
      const PetscInt group = (PetscInt)b->group;
      PetscReal      y[3], at;

      for (PetscInt a = 0; a < l->dim; a++) y[a] = DomainNearest(l->period[a], x[l->dim * i + a], b->X[a]);
      PetscCall(BodiesDistanceOf(s->c->bodies, group, b->scale, b->X, b->q, 1, y, &at));
      if (at < d[i] && angle) angle[i] = s->f->angle[group];
      d[i] = PetscMin(d[i], at);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* At rest tension times curvature is the jump of the pressure, which changes with the weight */
static void level(void *ctx, PetscInt drop, PetscReal gradient[3])
{
  const WettedBodies *s = (const WettedBodies *)ctx;
  const DropsState   *d = s->f->s;
  const DropGroup    *g = d->group + d->drop[DropsFind(d, drop)].group;

  for (PetscInt a = 0; a < 3; a++)
    gradient[a] = g->tension > 0 ? (s->c->par->density - g->density) * s->c->par->gravity[a] / g->tension : 0;
}

static PetscBool is_wetted(const CoupleDrops *f, Couple c, PetscInt k)
{
  return (PetscBool)(c->s->own[k] && !c->s->removed[k] && f->angle[c->s->body_group[k]] > 0);
}

/* Bodies that are wetted, where they will be at the end of the step, on all ranks; predicted here, or drawn already */
static PetscErrorCode gather_bodies(const CoupleDrops *f, Couple c, PetscBool drawn, WettedBodies *s)
{
  Wetted  *own;
  PetscInt n = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->s->n, &own));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal angle;
    Wetted   *b = own + n;

    if (!is_wetted(f, c, k)) continue;
    b->group = (PetscReal)c->s->body_group[k];
    b->scale = c->s->scale[k];
    if (drawn) {
      PetscCall(PetscArraycpy(b->X, c->rigid.X[k], 3));
      PetscCall(PetscArraycpy(b->q, c->rigid.q[k], 4));
    } else PetscCall(BodiesPredict(c->bodies, k, c->step->dt, c->implicit ? c->step->order : 0, b->X, b->q, &angle));
    n++;
  }
  PetscCall(SparseGather(BodiesComm(c->bodies), n, sizeof(*own), own, &s->n, &s->body, NULL));
  PetscCall(PetscFree(own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What drops have inside of bodies at the end of the step, as it has changed so far */
static void predict_insides(DropsState *s)
{
  for (PetscInt k = 0; k < s->n; k++) {
    Drop           *d    = s->drop + k;
    const PetscReal next = PetscMax(0, 2 * d->inside - d->inside_old);

    d->inside_old = d->inside;
    d->inside     = next;
  }
}

/* The first group for which walls are no mirrors: that wets them, and not at a right angle; -1: there is none */
static PetscInt find_unlike_mirror(const DropsState *s)
{
  for (PetscInt g = 0; g < s->ngroups; g++)
    if (s->group[g].wets && PetscAbsReal(PetscCosReal(s->group[g].contact)) >= PETSC_SMALL) return g;
  return -1;
}

PetscErrorCode DropsCheckMirrors(const CoupleDrops *f, Couple c)
{
  const MeshLocal *l    = c->loc;
  const PetscInt  *wets = PhaseSurfacesGet(f->surfaces)->ends_on, group = find_unlike_mirror(f->s);
  PetscInt         at = -1, side; /* 6 times group of the body, and the side */

  PetscFunctionBeginUser;
  if (!f->meets || group < 0 || !wets) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < 2 * l->dim * c->s->n; i++) {
    const PetscInt  k = i / (2 * l->dim), s = i % (2 * l->dim), a = s / 2;
    const PetscReal gap = s % 2 ? l->upper[a] - c->s->x[k][a] : c->s->x[k][a] - l->lower[a];

    if (is_wetted(f, c, k) && *wets >> s & 1 && gap < ACROSS * BodiesGetRadius(c->s, k))
      at = PetscMax(at, 6 * c->s->body_group[k] + s);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at, 1, MPIU_INT, MPI_MAX, c->comm));
  if (at < 0) PetscFunctionReturn(PETSC_SUCCESS);
  side = at % 6;
  SETERRQ(c->comm, PETSC_ERR_USER_INPUT,
          "A body of group '%s' lies across the side %c = %g of the domain, which is no mirror, since the fluid '%s' meets it at %.3g degrees: "
          "give -particle_%s_contact_angle 90 deg, or move the body (-particle_%s_position)",
          c->s->group[at / 6].name, "xyz"[side / 2], (double)(side % 2 ? l->upper : l->lower)[side / 2],
          f -> s -> group[group].name, (double)(f->s->group[group].contact * 180 / PETSC_PI), f->s->group[group].name,
          c->s->group[at / 6].name);
}

PetscErrorCode DropsMeetBodies(CoupleDrops *f, Couple c)
{
  WettedBodies s     = {.c = c, .f = f};
  PhaseSolid   solid = {.ctx      = &s,
                        .h        = c->loc->h,
                        .mirrors  = (PetscBool)(find_unlike_mirror(f->s) < 0),
                        .distance = distance,
                        .level    = level};

  PetscFunctionBeginUser;
  if (!f->meets) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesSetTime(c->bodies, c->step->time - c->step->dt));
  PetscCall(gather_bodies(f, c, PETSC_FALSE, &s));
  if (c->loc->dim == 2) PetscCall(PhaseCurveMeet(&f->interface.curve, &solid));
  else PetscCall(PhaseSheetMeet(&f->interface.sheet, &solid));
  PetscCall(PetscFree(s.body));
  predict_insides(f->s);
  f->met++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* f->fraction [ncell_all]: the part of a cell that is in no body */
static PetscErrorCode find_outside(CoupleDrops *f, Couple c)
{
  CutCells         cells;
  const CutCell   *cut;
  const PetscReal *size;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(FlowGetCellSize(c->flow, &size));
  for (PetscInt e = 0; e < c->loc->ncell_all; e++) f->fraction[e] = 1;
  PetscCall(PenaltyGetCutCells((*c->method.table->penalty)(c->method.data), &cells));
  PetscCall(CutCellsGet(cells, &n, &cut));
  for (PetscInt t = 0; t < n; t++) {
    const PetscReal part = cut[t].moments < 0 ? 1
                                              : cut[t].volume / PetscPowRealInt(size[cut[t].cell], (int)c->loc->dim);

    f->fraction[cut[t].cell] = PetscMax(0, f->fraction[cut[t].cell] - part);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsTakeBodies(CoupleDrops *f, Couple c)
{
  const PetscInt   n = f->s->n;
  const PetscReal *size;
  PetscReal       *inside;

  PetscFunctionBeginUser;
  if (!f->meets) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_outside(f, c));
  PetscCall(FlowGetCellSize(c->flow, &size));
  PetscCall(PetscCalloc1(n, &inside));
  for (PetscInt e = 0; e < c->loc->ncell; e++) {
    const PetscInt k = DropsFind(f->s, f->cell_drop[e]);

    if (k >= 0) inside[k] += (1 - f->fraction[e]) * PetscPowRealInt(size[e], (int)c->loc->dim);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, inside, (PetscMPIInt)n, MPIU_REAL, MPIU_SUM, c->comm));
  for (PetscInt k = 0; k < n; k++) {
    Drop *d = f->s->drop + k;

    if (!f->met) d->target -= inside[k];
    if (d->inside == 0 || f->met == 2) d->inside_old = inside[k];
    d->inside = inside[k];
  }
  f->met = PetscMax(1, f->met);
  PetscCall(PetscFree(inside));
  PetscCall(DropsSetProperties(f, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- weight inside of bodies ---- */

/* force [nb][dim] += load times the integrals of the basis over a cell with nodes xc */
static void add_load(PetscInt dim, PetscInt nb, const PetscReal xc[], const PetscReal load[], PetscReal force[])
{
  for (PetscInt q = 0; q < nb; q++) {
    PetscReal       phi[MESH_MAX_NB];
    const PetscReal w = ElementGaussPoint(dim, xc, q, phi);

    for (PetscInt j = 0; j < dim * nb; j++) force[j] += w * phi[j / dim] * load[j % dim];
  }
}

/* Of a part of a body in an own cell of a drop: gravity on the nodes, where no wall takes it, and what the body gives
   back, about its centre */
static PetscErrorCode add_weight(CoupleDrops *f, Couple c, const CutCell *cut, PetscReal size, PetscReal sum[6])
{
  const MeshLocal     *l    = c->loc;
  const PetscInt      *node = l->cell_node + cut->cell * l->nb, dim = l->dim;
  const DropGroup     *g    = f->s->group + f->s->drop[DropsFind(f->s, f->cell_drop[cut->cell])].group;
  const PetscReal      part = cut->moments < 0 ? 1 : cut->volume / PetscPowRealInt(size, (int)dim);
  PetscReal            load[3], xc[3 * MESH_MAX_NB], force[3 * MESH_MAX_NB] = {0};
  const unsigned char *fixed;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(c->flow), &fixed, NULL));
  for (PetscInt a = 0; a < 3; a++) load[a] = part * (g->density - c->par->density) * c->par->gravity[a];
  PetscCall(MeshCellCoordinates(c->mesh, cut->cell, xc));
  add_load(dim, l->nb, xc, load, force);
  for (PetscInt j = 0; j < l->nb; j++) {
    PetscReal arm[3] = {0}, F[3] = {0}, torque[3];

    for (PetscInt a = 0; a < dim; a++) {
      F[a]   = fixed[node[j]] >> a & 1 ? 0 : force[dim * j + a];
      arm[a] = MeshNearest(l, a, xc[dim * j + a] - c->rigid.X[cut->body][a]);
      f->load[dim * node[j] + a] += F[a];
    }
    cross(arm, F, torque);
    for (PetscInt a = 0; a < 3; a++) {
      sum[a] -= F[a];
      sum[3 + a] -= torque[a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsLoadBodies(CoupleDrops *f, Couple c)
{
  CutCells         cells;
  const CutCell   *cut;
  const PetscReal *size;
  PetscReal(*sum)[6] = f->weight_of_bodies;
  PetscInt n;

  PetscFunctionBeginUser;
  if (!f->meets) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArrayzero(sum, c->s->n));
  PetscCall(PetscArrayzero(f->load, c->loc->dim * c->loc->nnode_all));
  PetscCall(FlowGetCellSize(c->flow, &size));
  PetscCall(PenaltyGetCutCells((*c->method.table->penalty)(c->method.data), &cells));
  PetscCall(CutCellsGet(cells, &n, &cut));
  for (PetscInt t = 0; t < n; t++)
    if (cut[t].cell < c->loc->ncell && f->cell_drop[cut[t].cell] >= 0)
      PetscCall(add_weight(f, c, cut + t, size[cut[t].cell], sum[cut[t].body]));
  PetscCall(FlowAddForce(c->flow, &f->load, f->load));
  PetscCall(BodiesSumLocal(c->bodies, 6, (PetscReal *)sum));
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal out[6];

    PetscCall(RigidReduceForce(c->bodies, k, c->rigid.q[k], sum[k], sum[k] + 3, out));
    for (PetscInt i = 0; i < c->nr; i++) c->rigid.g[k * c->nr + i] += out[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsAddForces(CoupleDrops *f, Couple c)
{
  PetscReal(*force)[3], (*torque)[3];

  PetscFunctionBeginUser;
  if (!f->meets) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesWriteForces(c->bodies, &force, &torque));
  for (PetscInt i = 0; i < 3 * c->s->n; i++) {
    force[i / 3][i % 3] += f->weight_of_bodies[i / 3][i % 3];
    torque[i / 3][i % 3] += f->weight_of_bodies[i / 3][3 + i % 3];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- energy ---- */

/* Of something of this size, length or area, what is inside where its middle has the distance d */
static PetscReal size_inside(PetscInt dim, PetscReal size, PetscReal d)
{
  const PetscReal across = dim == 2 ? size : PetscSqrtReal(size);

  return size * PetscMax(0, PetscMin(1, 0.5 - d / across));
}

/* Of edge or face e of the interface, its length or area inside of bodies: nothing where they are away from it */
static PetscErrorCode measure_inside(WettedBodies *s, const PhaseInterface *f, PetscInt e, PetscReal *sum)
{
  const PetscInt   dim = s->c->loc->dim, n = dim == 2 ? PIECES : PIECES * PIECES;
  const PetscReal *ball = dim == 2 ? f->curve.ball[e] : f->sheet.ball[e];
  PetscReal        x[3 * PIECES * PIECES], size[PIECES * PIECES], d[PIECES * PIECES];

  PetscFunctionBeginUser;
  *sum = 0;
  PetscCall(distance(s, 1, ball, d, NULL));
  if (d[0] > 2 * ball[dim]) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal at[2] = {(PetscReal)(2 * (i % PIECES) + 1) / PIECES - 1,
                             (PetscReal)(2 * (i / PIECES) + 1) / PIECES - 1};

    if (dim == 2) {
      PetscReal t[2];

      EdgeEvaluate(f->curve.x[e], at[0], x + 2 * i, t);
      size[i] = PetscHypotReal(t[0], t[1]) * 2 / PIECES;
    } else {
      FacePoint p;
      PetscReal normal[3];

      FaceEvaluate(3, (const PetscReal(*)[3])f->sheet.x[e], at, &p);
      cross(p.t[0], p.t[1], normal);
      PetscCall(PetscArraycpy(x + 3 * i, p.x, 3));
      size[i] = PetscSqrtReal(dot3(normal, normal)) * 4 / n;
    }
  }
  PetscCall(distance(s, n, x, d, NULL));
  for (PetscInt i = 0; i < n; i++) *sum += size_inside(dim, size[i], d[i]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal tension_of(const DropsState *s, PetscInt number)
{
  return s->group[s->drop[DropsFind(s, number)].group].tension;
}

/* Of own body k, tension times what of its surface is in drops */
static PetscErrorCode measure_wetted(const CoupleDrops *f, Couple c, PetscInt k, PetscReal *sum)
{
  const PetscInt npoint = POINTS * (c->loc->dim == 2 ? 1 : 10);
  PetscInt       n;
  PetscReal     *x, *w;

  PetscFunctionBeginUser;
  *sum = 0;
  PetscCall(BodiesSurfacePoints(c->bodies, k, c->rigid.X[k], c->rigid.q[k], npoint, &n, &x, &w));
  for (PetscInt i = 0; i < npoint; i++) {
    const PetscReal *middle;
    PhasePoint       p;
    PetscInt         number;

    DropsNearest(&f->s->interface, c->loc, x + c->loc->dim * i, PETSC_MAX_REAL / 4, &p);
    if (p.edge < 0) continue;
    (void)PhaseInterfacePiece(&f->s->interface, p.edge, &number, &middle);
    *sum += tension_of(f->s, number) * size_inside(c->loc->dim, w[i], p.d);
  }
  PetscCall(PetscFree(x));
  PetscCall(PetscFree(w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of this rank: the power of the weight inside of bodies, and of what they give back */
static PetscErrorCode add_weight_power(const CoupleDrops *f, Couple c, PetscReal *power)
{
  PetscReal out[6];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->loc->dim * c->loc->nnode_all; i++) *power += f->load[i] * c->field.u[i];
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal *w = f->weight_of_bodies[k];

    if (!c->s->own[k]) continue;
    PetscCall(RigidReduceForce(c->bodies, k, c->rigid.q[k], w, w + 3, out));
    for (PetscInt i = 0; i < c->nr; i++) *power += out[i] * c->rigid.U[k * c->nr + i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of this rank: the energy of surfaces beside that of whole drops */
static PetscErrorCode add_wetted(const CoupleDrops *f, Couple c, PetscReal *energy)
{
  WettedBodies s = {.c = c, .f = f};
  PetscReal    more;
  PetscMPIInt  rank, nrank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->comm, &rank));
  PetscCallMPI(MPI_Comm_size(c->comm, &nrank));
  PetscCall(gather_bodies(f, c, PETSC_TRUE, &s));
  for (PetscInt e = rank; e < PhaseInterfaceSize(&f->s->interface); e += nrank) {
    const PetscReal *middle;
    PetscInt         number;

    if (!PhaseInterfacePiece(&f->s->interface, e, &number, &middle)) continue;
    PetscCall(measure_inside(&s, &f->s->interface, e, &more));
    *energy -= tension_of(f->s, number) * more;
  }
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (!is_wetted(f, c, k)) continue;
    PetscCall(measure_wetted(f, c, k, &more));
    *energy -= PetscCosReal(f->angle[c->s->body_group[k]]) * more;
  }
  PetscCall(PetscFree(s.body));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsAddEnergyOfBodies(const CoupleDrops *f, Couple c, CouplePower *w)
{
  PetscReal sum[2] = {0};

  PetscFunctionBeginUser;
  if (!f->meets) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_wetted(f, c, &sum[0]));
  PetscCall(add_weight_power(f, c, &sum[1]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, c->comm));
  w->energy += sum[0];
  w->power += sum[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsVisitBodies(CoupleDrops *f, State state)
{
  PetscReal *value;

  PetscFunctionBeginUser;
  if (!f->meets) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(StateInts(state, "drops_met", 1, &f->met));
  PetscCall(PetscMalloc1(2 * f->s->n, &value));
  for (PetscInt k = 0; k < f->s->n; k++) {
    value[2 * k]     = f->s->drop[k].inside;
    value[2 * k + 1] = f->s->drop[k].inside_old;
  }
  PetscCall(StateReals(state, "drops_inside", 2 * f->s->n, value));
  for (PetscInt k = 0; k < f->s->n; k++) {
    f->s->drop[k].inside     = value[2 * k];
    f->s->drop[k].inside_old = value[2 * k + 1];
  }
  PetscCall(PetscFree(value));
  PetscFunctionReturn(PETSC_SUCCESS);
}
