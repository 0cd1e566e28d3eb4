/* Bodies: velocities of surfaces beside the rigid motion, see bodies/slip.h. */
#include "compat.h"
#include "bodies/slip.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/opt.h"

#define MAX_MODES 16
#define STEP      1e-5 /* of differences, in radii */

struct _p_BodySlip {
  PetscInt  dim, nmodes;
  PetscReal mode[MAX_MODES], velocity[3], e[3]; /* e: direction of swimming in the frame of the shape */
  Expr      mode_of, velocity_of, mobility_of;  /* NULL: the numbers */
  PetscReal mobility;
  char      scalar[64]; /* "": no mobility */
};

/* ---- options ---- */

static PetscErrorCode read_mobility(const char group[], PetscInt dim, BodySlip s, PetscBool *found)
{
  char      name[OPT_NAME], scalar[OPT_NAME];
  PetscBool has_scalar;

  PetscFunctionBeginUser;
  PetscCall(
    ExprRead(OptJoin("-particle_", group, "_slip_mobility", name), dim, 1, &s->mobility, &s->mobility_of, found));
  PetscCall(OptHas(OptJoin("-particle_", group, "_slip_scalar", scalar), &has_scalar));
  PetscCall(OptString(scalar, s->scalar, sizeof(s->scalar)));
  PetscCheck(*found == has_scalar, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s and %s need one another: mobility times the gradient of the scalar is the slip", name, scalar);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySlipRead(const char group[], PetscInt dim, PetscReal disc, BodySlip *slip)
{
  char      name[OPT_NAME], modes[OPT_NAME];
  BodySlip  s;
  PetscBool has_velocity, has_direction, has_mobility;
  PetscReal length;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->dim  = dim;
  s->e[0] = 1;
  PetscCall(OptCountItems(OptJoin("-particle_", group, "_slip_modes", modes), &s->nmodes));
  PetscCheck(s->nmodes <= MAX_MODES, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s has %" PetscInt_FMT " modes: give at most %d", modes, s->nmodes, MAX_MODES);
  if (s->nmodes) PetscCall(ExprRead(modes, dim, s->nmodes, s->mode, &s->mode_of, NULL));
  PetscCheck(!s->nmodes || disc > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s is for discs and spheres: give -particle_%s_slip_velocity of another shape", modes, group);
  PetscCall(ExprRead(OptJoin("-particle_", group, "_slip_velocity", name), dim, dim, s->velocity, &s->velocity_of,
                     &has_velocity));
  PetscCheck(!has_velocity || !s->nmodes, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s and %s both give the slip of group '%s': remove one of them", modes, name, group);
  PetscCall(read_mobility(group, dim, s, &has_mobility));
  PetscCheck(!has_mobility || (!has_velocity && !s->nmodes), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_slip_mobility and %s both give the slip of group '%s': remove one of them", group,
             s->nmodes ? modes : name, group);
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_slip_direction", name), dim, s->e, &has_direction));
  length = PetscSqrtReal(dot3(s->e, s->e));
  PetscCheck(length > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: a direction has a length: give one that is not zero", name);
  PetscCheck(!has_direction || s->nmodes || has_velocity || has_mobility, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s needs %s, -particle_%s_slip_velocity or -particle_%s_slip_mobility", name, modes, group, group);
  for (PetscInt a = 0; a < 3; a++) s->e[a] /= length;
  *slip = s;
  if (!s->nmodes && !has_velocity && !has_mobility) PetscCall(BodySlipDestroy(slip));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodySlipDestroy(BodySlip *slip)
{
  PetscFunctionBeginUser;
  if (!*slip) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ExprDestroy(&(*slip)->mode_of));
  PetscCall(ExprDestroy(&(*slip)->velocity_of));
  PetscCall(ExprDestroy(&(*slip)->mobility_of));
  PetscCall(PetscFree(*slip));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const char *BodySlipScalar(BodySlip s)
{
  return s->scalar[0] ? s->scalar : NULL;
}

PetscBool BodySlipHasModes(BodySlip s)
{
  return (PetscBool)(s->nmodes > 0);
}

PetscBool BodiesHaveSlip(Bodies b)
{
  for (PetscInt g = 0; g < b->state.ngroups; g++)
    if (b->state.group[g].slip && b->state.group[g].count) return PETSC_TRUE;
  return PETSC_FALSE;
}

PetscBool BodiesSlipChanges(Bodies b)
{
  for (PetscInt g = 0; g < b->state.ngroups; g++) {
    const struct _p_BodySlip *s = b->state.group[g].slip;

    if (s && s->mode_of) return PETSC_TRUE;
    if (s && s->velocity_of && ExprUsesTime(s->velocity_of)) return PETSC_TRUE;
    if (s && s->mobility_of && ExprUsesTime(s->mobility_of)) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* ---- modes ---- */

static PetscErrorCode get_modes(const struct _p_BodySlip *s, PetscReal time, PetscReal B[])
{
  PetscReal variable[EXPR_VARIABLES] = {0};

  PetscFunctionBeginUser;
  variable[EXPR_TIME] = time;
  if (s->mode_of) PetscCall(ExprEvaluateAt(s->mode_of, variable, NULL, B));
  else PetscCall(PetscArraycpy(B, s->mode, s->nmodes));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* v at y [3], in radii from the centre, in the plane: u_r = sum B n/2 (r^(n-1) - r^(n+1)) cos(n theta), u_theta = sum
   B/2 ((n + 2) r^(n+1) - n r^(n-1)) sin(n theta) */
static void add_plane_modes(const struct _p_BodySlip *s, const PetscReal B[], const PetscReal y[], PetscReal v[])
{
  const PetscReal along = y[0] * s->e[0] + y[1] * s->e[1], across = y[1] * s->e[0] - y[0] * s->e[1];
  const PetscReal r = PetscSqrtReal(along * along + across * across), theta = r > 0 ? atan2(across, along) : 0;
  PetscReal       ur = 0, ut = 0, power = 1; /* r^(n-1) */

  for (PetscInt n = 1; n <= s->nmodes; n++, power *= r) {
    ur += 0.5 * B[n - 1] * (PetscReal)n * power * (1 - r * r) * PetscCosReal((PetscReal)n * theta);
    ut += 0.5 * B[n - 1] * power * ((PetscReal)(n + 2) * r * r - (PetscReal)n) * PetscSinReal((PetscReal)n * theta);
  }
  for (PetscInt a = 0; a < 2; a++) {
    const PetscReal e = s->e[a], f = a ? s->e[0] : -s->e[1];

    v[a] = (ur * PetscCosReal(theta) - ut * PetscSinReal(theta)) * e +
           (ur * PetscSinReal(theta) + ut * PetscCosReal(theta)) * f;
  }
}

/* The same in space: u_r = sum B (r^(n-1) - r^(n+1)) P_n, u_theta = sum B/2 ((n + 3) r^(n+1) - (n + 1) r^(n-1)) V_n */
static void add_space_modes(const struct _p_BodySlip *s, const PetscReal B[], const PetscReal y[], PetscReal v[])
{
  const PetscReal r = PetscSqrtReal(dot3(y, y)), c = r > 0 ? dot3(y, s->e) / r : 1;
  PetscReal       P[2] = {1, c}, slope[2] = {0, 1}, power = 1, radial = 0, axial = 0; /* P_{n-1}, P_n; their slopes */

  for (PetscInt n = 1; n <= s->nmodes; n++, power *= r) {
    const PetscReal m = (PetscReal)n, ut = B[n - 1] * power * ((m + 3) * r * r - (m + 1)) * slope[1] / (m * (m + 1)),
                    up = ((2 * m + 1) * c * P[1] - m * P[0]) / (m + 1), next = slope[0] + (2 * m + 1) * P[1];

    radial += B[n - 1] * power * (1 - r * r) * P[1] + ut * c; /* theta V = (c r - e) 2 P'/(n (n + 1)) */
    axial -= ut;
    P[0]     = P[1];
    P[1]     = up;
    slope[0] = slope[1];
    slope[1] = next;
  }
  for (PetscInt a = 0; a < 3; a++) v[a] = (r > 0 ? radial * y[a] / r : radial * s->e[a]) + axial * s->e[a];
}

/* y in radii from the centre; on the surface at the point of it in that direction, which becomes y */
static PetscErrorCode evaluate_modes(const struct _p_BodySlip *s, PetscReal time, PetscBool surface, PetscReal y[3],
                                     PetscReal v[])
{
  const PetscReal r = PetscSqrtReal(dot3(y, y));
  PetscReal       B[MAX_MODES];

  PetscFunctionBeginUser;
  PetscCall(get_modes(s, time, B));
  for (PetscInt a = 0; a < 3 && surface && r > 0; a++) y[a] /= r;
  if (s->dim == 2) add_plane_modes(s, B, y, v);
  else add_space_modes(s, B, y, v);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- expressions ---- */

/* The tangential part of the velocity at the foot of y [dim], in the frame of the shape, which becomes the normal */
static PetscErrorCode evaluate_velocity(const BodyGroup *g, PetscInt dim, PetscReal time, PetscReal y[], PetscReal v[])
{
  const struct _p_BodySlip *s        = g->slip;
  const PetscReal           step     = STEP * g->radius;
  PetscReal variable[EXPR_VARIABLES] = {0}, foot[3] = {0, 0, 0}, n[3] = {0, 0, 0}, side[18], d[6], square = 0, across;

  PetscFunctionBeginUser;
  PetscCall(ShapeProject(g->shape, 1, y, foot));
  for (PetscInt i = 0; i < 2 * dim; i++)
    for (PetscInt a = 0; a < dim; a++) side[i * dim + a] = foot[a] + (i / 2 != a ? 0 : i % 2 ? -step : step);
  PetscCall(ShapeDistance(g->shape, 2 * dim, side, d));
  for (PetscInt a = 0; a < dim; a++) {
    n[a] = d[2 * a] - d[2 * a + 1];
    square += n[a] * n[a];
    variable[EXPR_X + a] = foot[a];
  }
  variable[EXPR_TIME] = time;
  if (s->velocity_of) PetscCall(ExprEvaluateAt(s->velocity_of, variable, NULL, v));
  else PetscCall(PetscArraycpy(v, s->velocity, dim));
  across = square > 0 ? dot3(n, v) / square : 0;
  for (PetscInt a = 0; a < dim; a++) {
    v[a] -= across * n[a];
    y[a] = square > 0 ? n[a] / PetscSqrtReal(square) : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- in space ---- */

/* x in the frame of the shape */
static void enter_frame(Bodies b, PetscInt k, const PetscReal X[3], const PetscReal R[9], const PetscReal x[],
                        PetscReal y[3])
{
  for (PetscInt a = 0; a < 3; a++) {
    y[a] = 0;
    for (PetscInt d = 0; d < b->state.dim && a < b->state.dim; d++)
      y[a] += R[3 * d + a] * (x[d] - X[d]) / b->state.scale[k];
  }
}

PetscErrorCode BodiesGetSlipMobility(Bodies b, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal time,
                                     const PetscReal x[], PetscReal *mobility)
{
  PetscReal        variable[EXPR_VARIABLES] = {0}, R[9], y[3];
  const BodyGroup *g;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g         = BodiesGetGroup(&b->view, k);
  *mobility = g->slip->mobility;
  if (!g->slip->mobility_of) PetscFunctionReturn(PETSC_SUCCESS);
  RotationMatrix(q, R);
  enter_frame(b, k, X, R, x, y);
  for (PetscInt a = 0; a < b->state.dim; a++) variable[EXPR_X + a] = y[a] + g->mass.centroid[a];
  variable[EXPR_TIME] = time >= PETSC_MAX_REAL ? 0 : time;
  PetscCall(ExprEvaluateAt(g->slip->mobility_of, variable, NULL, mobility));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetSlip(Bodies b, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal time,
                             PetscBool surface, const PetscReal x[], PetscReal v[], PetscReal n[])
{
  const PetscInt   dim = b->state.dim;
  const BodyGroup *g;
  PetscReal        R[9], y[3], at[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g = BodiesGetGroup(&b->view, k);
  RotationMatrix(q, R);
  enter_frame(b, k, X, R, x, y);
  if (time >= PETSC_MAX_REAL) time = 0; /* of a steady problem */
  if (g->slip && g->slip->nmodes) {
    for (PetscInt a = 0; a < 3; a++) y[a] /= g->disc;
    PetscCall(evaluate_modes(g->slip, time, surface, y, at));
  } else if (g->slip) {
    for (PetscInt a = 0; a < dim; a++) y[a] += g->mass.centroid[a];
    PetscCall(evaluate_velocity(g, dim, time, y, at));
  }
  for (PetscInt a = 0; a < dim; a++) v[a] = dot3(R + 3 * a, at);
  for (PetscInt a = 0; a < dim && surface; a++) n[a] = dot3(R + 3 * a, y);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetSwimDirection(Bodies b, PetscInt k, const PetscReal q[4], PetscReal e[3])
{
  const BodyGroup *g;
  PetscReal        R[9];

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g = BodiesGetGroup(&b->view, k);
  RotationMatrix(q, R);
  for (PetscInt a = 0; a < 3; a++) e[a] = g->slip ? dot3(R + 3 * a, g->slip->e) : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetSlipInside(Bodies b, PetscInt k, PetscReal time, PetscReal *power)
{
  const struct _p_BodySlip *s;
  PetscReal                 B[MAX_MODES];

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  s      = BodiesGetGroup(&b->view, k)->slip;
  *power = 0;
  if (!s || !s->nmodes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(get_modes(s, time >= PETSC_MAX_REAL ? 0 : time, B));
  for (PetscInt i = 0; i < s->nmodes; i++) {
    const PetscReal n = (PetscReal)(i + 1);

    *power += s->dim == 2 ? 2 * PETSC_PI * n * B[i] * B[i]
                          : 16 * PETSC_PI * BodiesGetDisc(&b->view, k) * B[i] * B[i] / (n * (n + 1));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
