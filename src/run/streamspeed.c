/* Stream, its speed: see stream.h. Read before there is a flow, from the options that say what drives it. */
#include "compat.h"
#include "stream.h"
#include "base/algebra.h"
#include "base/domain.h"
#include "base/expr.h"
#include "base/opt.h"
#include "bodies/local.h"
#include "base/runcomm.h"
#include <string.h>

#define TIMES  64 /* of a run at which formulas are looked at */
#define POINTS 8  /* along each axis, for the mean of a force that depends on the position */
#define FORM \
  0.1 /* drag beyond the slow one, as a coefficient with the mean speed between the bodies: square arrays of
                      discs have .04 to .5, of ellipses at 30 degrees .8 to 1.5 (runs/studies/boundary); a layer goes by
                      the fourth root of it, so this is on the fast side */

/* ---- times and formulas ---- */

/* Until when a run in time goes, as far as it is known; 0: steady, or not known */
static PetscErrorCode find_end(PetscBool steady, PetscReal *end)
{
  PetscReal steps = 0, dt = 0.01;
  PetscBool given;

  PetscFunctionBeginUser;
  *end = 0;
  if (steady) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptPeekReal("-sim_time", end, &given));
  PetscCall(OptPeekReal("-sim_dt", &dt, &given));
  PetscCall(OptPeekReal("-sim_steps", &steps, &given));
  if (given && (*end == 0 || steps * dt < *end)) *end = steps * dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What -flow_bc_<boundary>_factor and _ramp make of a velocity or pressure at most */
static PetscErrorCode find_factor(const char boundary[], PetscReal *factor)
{
  char      option[OPT_NAME];
  PetscReal f[3] = {1, 0, 1};
  PetscInt  n;

  PetscFunctionBeginUser;
  PetscCall(OptPeekReals(OptJoin("-flow_bc_", boundary, "_factor", option), 3, f, &n));
  *factor = n == 3 ? PetscAbsReal(f[0]) + PetscAbsReal(f[1]) : 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode is_type(const char boundary[], const char type[], const char other[], PetscBool *yes)
{
  char option[OPT_NAME], text[64];

  PetscFunctionBeginUser;
  PetscCall(OptPeek(OptJoin("-flow_bc_", boundary, "_type", option), text, sizeof(text)));
  *yes = (PetscBool)(!strcasecmp(text, type) || !strcasecmp(text, other));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what boundaries prescribe ---- */

static void take_faster(Stream *stream, PetscReal factor, const PetscReal v[3])
{
  const PetscReal speed = PetscSqrtReal(dot3(v, v));

  if (factor * speed <= stream->speed) return;
  stream->speed = factor * speed;
  for (PetscInt a = 0; a < 3; a++) stream->direction[a] = v[a] / speed;
}

/* The fastest of a formula at the nodes of a boundary, while the run lasts */
static PetscErrorCode look_at_formula(Mesh mesh, PetscInt b, Expr formula, PetscReal factor, PetscReal end,
                                      Stream *stream)
{
  const MeshLocal *l;
  const PetscInt  *node;
  PetscInt         n;
  PetscReal       *x, *v;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetBoundaryNodes(mesh, b, &n, &node));
  PetscCall(PetscMalloc2(n * l->dim, &x, n * l->dim, &v));
  for (PetscInt i = 0; i < n * l->dim; i++) x[i] = l->x[node[i / l->dim] * l->dim + i % l->dim];
  for (PetscInt k = 0; k <= (ExprUsesTime(formula) ? TIMES : 0); k++) {
    PetscCall(ExprEvaluate(formula, k * end / TIMES, n, x, v));
    for (PetscInt i = 0; i < n; i++)
      take_faster(stream, factor, (PetscReal[3]){v[i * l->dim], v[i * l->dim + 1], l->dim == 3 ? v[i * 3 + 2] : 0});
  }
  PetscCall(PetscFree2(x, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode look_at_boundary(Mesh mesh, PetscInt b, PetscReal end, Stream *stream)
{
  const MeshLocal *l;
  const char      *name;
  char             option[OPT_NAME];
  PetscReal        factor, v[3] = {0, 0, 0};
  PetscBool        yes = PETSC_FALSE;
  Expr             formula;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetBoundaryName(mesh, b, &name));
  PetscCall(is_type(name, "inflow", "moving_wall", &yes));
  if (!yes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_factor(name, &factor));
  PetscCall(ExprPeek(OptJoin("-flow_bc_", name, "_velocity", option), l->dim, l->dim, v, &formula));
  if (!formula) take_faster(stream, factor, v);
  else PetscCall(look_at_formula(mesh, b, formula, factor, end, stream));
  PetscCall(ExprDestroy(&formula));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The fastest over all ranks, in the direction of the lowest rank that has it */
static PetscErrorCode agree(Stream *stream)
{
  PetscReal   fastest = stream->speed;
  PetscMPIInt rank, first;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(RunComm(), &rank));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &fastest, 1, MPIU_REAL, MPIU_MAX, RunComm()));
  first = stream->speed == fastest ? rank : PETSC_MPI_INT_MAX;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, RunComm()));
  stream->speed = fastest;
  PetscCallMPI(MPI_Bcast(stream->direction, 3, MPIU_REAL, first, RunComm()));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what forces drive ---- */

/* Of what holds the fluid back: resistance to a velocity, times it and times its square; and what is known of it */
typedef struct {
  PetscInt  dim;
  PetscReal density, viscosity, extent[3];
  PetscReal solid, open;    /* shares: of the box that held bodies take; of a section between them that they leave */
  PetscReal linear, square; /* force per volume of the box */
} Brake;

/* Drag of one body of that volume in an array that takes the share c of the box, for a mean velocity between the
   bodies of 1, slow: Kuwabara (1959) in the plane, Happel (1958) in space */
static PetscReal find_slow_drag(PetscInt dim, PetscReal c, PetscReal volume)
{
  const PetscReal g = PetscCbrtReal(c);

  c = PetscMin(PetscMax(c, 1e-8), 0.8);
  if (dim == 2) return (1 - c) * 8 * PETSC_PI / (-PetscLogReal(c) - 1.5 + 2 * c - c * c / 2);
  return (1 - c) * 6 * PETSC_PI * PetscCbrtReal(3 * volume / (4 * PETSC_PI)) * (1 + 2 * PetscPowReal(g, 5) / 3) /
         (1 - 1.5 * g + 1.5 * PetscPowReal(g, 5) - PetscPowReal(g, 6));
}

/* Of the held bodies */
static PetscErrorCode find_brake(const MeshLocal *l, Bodies bodies, Brake *b)
{
  BodyState *s;
  PetscReal  box = 1, sum[3] = {0, 0, 0}; /* number, volume, section of spheres (discs) of their volumes */

  PetscFunctionBeginUser;
  *b = (Brake){.dim = l->dim};
  PetscCall(StreamPeekFluid(&b->density, &b->viscosity));
  for (PetscInt a = 0; a < l->dim; a++) b->extent[a] = l->upper[a] - l->lower[a];
  PetscCall(BodiesGetState(bodies, &s));
  for (PetscInt a = 0; a < b->dim; a++) box *= b->extent[a];
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal volume;

    if (!s->own[k] || s->group[s->body_group[k]].free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z)) continue;
    PetscCall(BodiesGetVolume(bodies, k, &volume));
    sum[0] += 1;
    sum[1] += volume;
    sum[2] += b->dim == 2 ? PetscSqrtReal(4 * volume / PETSC_PI)
                          : PETSC_PI / 4 * PetscPowReal(6 * volume / PETSC_PI, 2. / 3);
  }
  PetscCall(BodiesSum(bodies, 3, sum));
  b->solid = PetscMin(0.9, sum[1] / box);
  b->open  = 1 - PetscMin(0.9, b->dim == 2 ? PetscSqrtReal(4 * b->solid / PETSC_PI)
                                           : PETSC_PI / 4 * PetscPowReal(6 * b->solid / PETSC_PI, 2. / 3));
  if (sum[0] > 0) b->linear = b->viscosity * sum[0] * find_slow_drag(b->dim, b->solid, sum[1] / sum[0]) / box;
  b->square = 0.5 * b->density * FORM * sum[2] / box;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Walls of a channel along the axis: 12 mu / H^2 for two that face each other, 3 for one beside one that slips */
static PetscErrorCode add_walls(PetscInt along, const MeshLocal *l, Brake *b)
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < b->dim; a++) {
    PetscInt sticks = 0;

    if (a == along || l->period[a] > 0) continue;
    for (PetscInt side = 2 * a; side < 2 * a + 2; side++) {
      char option[OPT_NAME], text[64];

      PetscCall(OptPeek(OptJoin("-flow_bc_", DOMAIN_SIDE[side], "_type", option), text, sizeof(text)));
      sticks += !text[0] || !strcasecmp(text, "no_slip") || !strcasecmp(text, "moving_wall");
    }
    b->linear += (sticks == 2 ? 12 : sticks == 1 ? 3 : 0) * b->viscosity / (b->extent[a] * b->extent[a]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mean over the box of what -flow_force says at a time */
static PetscErrorCode average_force(const MeshLocal *l, Expr formula, PetscReal time, PetscReal f[3])
{
  PetscInt   n = 1;
  PetscReal *x, *v;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < l->dim; a++) n *= POINTS;
  PetscCall(PetscMalloc2(n * l->dim, &x, n * l->dim, &v));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0, index = i; a < l->dim; a++, index /= POINTS)
      x[i * l->dim + a] = l->lower[a] + (index % POINTS + 0.5) / POINTS * (l->upper[a] - l->lower[a]);
  PetscCall(ExprEvaluate(formula, time, n, x, v));
  for (PetscInt a = 0; a < l->dim; a++) f[a] = 0;
  for (PetscInt i = 0; i < n * l->dim; i++) f[i % l->dim] += v[i] / n;
  PetscCall(PetscFree2(x, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest mean force [3] of all times; *impulse: the largest size of its integral from the start, infinite if it stays
   and the end of the run is not known */
static PetscErrorCode find_force(const MeshLocal *l, PetscReal end, PetscReal force[3], PetscReal *impulse)
{
  PetscReal f[3] = {0, 0, 0}, sum[3] = {0, 0, 0}, largest = 0;
  PetscInt  times = TIMES;
  Expr      formula;

  PetscFunctionBeginUser;
  PetscCall(ExprPeek("-flow_force", l->dim, l->dim, f, &formula));
  for (PetscInt a = 0; a < 3; a++) force[a] = 0;
  *impulse = 0;
  if (!formula || !ExprUsesTime(formula)) times = 1;
  for (PetscInt k = 0; k < times; k++) {
    if (formula) PetscCall(average_force(l, formula, (k + 0.5) * end / times, f));
    for (PetscInt a = 0; a < 3; a++) sum[a] += f[a] * end / times;
    *impulse = PetscMax(*impulse, PetscSqrtReal(dot3(sum, sum)));
    if (dot3(f, f) <= largest) continue;
    largest = dot3(f, f);
    for (PetscInt a = 0; a < 3; a++) force[a] = f[a];
  }
  if (end == 0) *impulse = PETSC_MAX_REAL;
  PetscCall(ExprDestroy(&formula));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A side of the box; where it is open, the pressure outside it, of a formula that at its middle */
typedef struct {
  PetscBool open;
  PetscReal p, factor, x[3];
  Expr      formula; /* or NULL */
} Opening;

static PetscErrorCode find_opening(const MeshLocal *l, PetscInt side, Opening *o)
{
  char option[OPT_NAME];

  PetscFunctionBeginUser;
  *o = (Opening){PETSC_FALSE};
  PetscCall(is_type(DOMAIN_SIDE[side], "pressure", "outflow", &o->open));
  if (!o->open) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_factor(DOMAIN_SIDE[side], &o->factor));
  PetscCall(ExprPeek(OptJoin("-flow_bc_", DOMAIN_SIDE[side], "_pressure", option), l->dim, 1, &o->p, &o->formula));
  for (PetscInt a = 0; a < 3; a++) o->x[a] = 0.5 * (l->lower[a] + l->upper[a]);
  o->x[side / 2] = side % 2 ? l->upper[side / 2] : l->lower[side / 2];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest gradient between the openings at both ends of an axis; *flows: is it open at both, or periodic? */
static PetscErrorCode find_gradient(const MeshLocal *l, PetscInt a, PetscReal end, PetscReal *largest, PetscBool *flows)
{
  Opening   o[2];
  PetscReal p[2];

  PetscFunctionBeginUser;
  *largest = 0;
  *flows   = PETSC_TRUE;
  if (l->period[a] > 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < 2; i++) PetscCall(find_opening(l, 2 * a + i, &o[i]));
  *flows = (PetscBool)(o[0].open && o[1].open);
  for (PetscInt k = 0; k < TIMES && *flows; k++) {
    for (PetscInt i = 0; i < 2; i++) {
      p[i] = o[i].p;
      if (o[i].formula) PetscCall(ExprEvaluate(o[i].formula, (k + 0.5) * end / TIMES, 1, o[i].x, &p[i]));
      p[i] *= o[i].factor;
    }
    *largest = PetscMax(*largest, PetscAbsReal(p[0] - p[1]) / (l->upper[a] - l->lower[a]));
  }
  for (PetscInt i = 0; i < 2; i++) PetscCall(ExprDestroy(&o[i].formula));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Steady velocity between the bodies of a mean force f, at which what holds the fluid back is as large */
static PetscReal find_balance(const Brake *b, PetscReal f)
{
  if (f == 0) return 0;
  if (b->square == 0) return b->linear > 0 ? f / b->linear : PETSC_MAX_REAL;
  return 2 * f / (b->linear + PetscSqrtReal(b->linear * b->linear + 4 * b->square * f));
}

/* Along axis a, of a force per volume and a gradient of the pressure; 0: nothing flows */
static PetscErrorCode find_speed(const MeshLocal *l, Brake b, PetscInt a, PetscReal f, PetscReal gradient,
                                 PetscReal impulse, PetscReal end, PetscReal *speed)
{
  PetscFunctionBeginUser;
  if (l->period[a] == 0) b.square += 0.5 * b.density / b.extent[a]; /* to make it move, once on its way through */
  PetscCall(add_walls(a, l, &b));
  *speed = find_balance(&b, PetscAbsReal(f) + gradient);
  if (impulse < PETSC_MAX_REAL) *speed = PetscMin(*speed, (impulse + gradient * end) / b.density);
  *speed *= (1 - b.solid) / b.open;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What force and openings drive */
static PetscErrorCode look_at_forces(const MeshLocal *l, Bodies bodies, PetscReal end, Stream *stream)
{
  Brake     b;
  PetscReal f[3], impulse = 0, gradient[3], v[3] = {0, 0, 0};
  PetscBool flows[3], any = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(find_force(l, end, f, &impulse));
  for (PetscInt a = 0; a < l->dim; a++) {
    PetscCall(find_gradient(l, a, end, &gradient[a], &flows[a]));
    flows[a] = (PetscBool)(flows[a] && (f[a] != 0 || gradient[a] > 0));
    any      = (PetscBool)(any || flows[a]);
  }
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_brake(l, bodies, &b));
  for (PetscInt a = 0; a < l->dim; a++) {
    if (flows[a]) PetscCall(find_speed(l, b, a, f[a], gradient[a], impulse, end, &v[a]));
    v[a] = f[a] < 0 ? -v[a] : v[a];
  }
  take_faster(stream, 1, v);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A mean velocity that -flow_rate keeps, in narrower sections */
static PetscErrorCode look_at_rate(const MeshLocal *l, Bodies bodies, Stream *stream)
{
  PetscReal v[3] = {0, 0, 0};
  PetscInt  n;
  Brake     b;

  PetscFunctionBeginUser;
  PetscCall(OptPeekReals("-flow_rate", 3, v, &n));
  if (n != l->dim) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(find_brake(l, bodies, &b));
  take_faster(stream, 1 / b.open, v);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode StreamFind(Mesh mesh, Bodies bodies, PetscBool steady, Stream *stream)
{
  const MeshLocal *l;
  PetscInt         n;
  PetscReal        end;

  PetscFunctionBeginUser;
  *stream = (Stream){.speed = 0, .direction = {1, 0, 0}};
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetBoundaryCount(mesh, &n));
  PetscCall(find_end(steady, &end));
  for (PetscInt b = 0; b < n; b++) PetscCall(look_at_boundary(mesh, b, end, stream));
  PetscCall(agree(stream));
  if (stream->speed > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(look_at_rate(l, bodies, stream));
  if (stream->speed > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(look_at_forces(l, bodies, end, stream));
  PetscFunctionReturn(PETSC_SUCCESS);
}
