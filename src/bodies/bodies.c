/* Bodies: rigid bodies in groups, their state and their motion, see bodies.h; the options of the groups are read in bodygroup.c.

   Method: Newton-Euler equations. Velocity: Euler step under the force of the step; rotation in 3D by the implicit midpoint rule for
   the gyroscopic term w x (I w), which keeps the energy of a torque-free body (Newton's method on 3 unknowns). Position: explicit with a
   weighted mean of old and new velocity, orientation by the exponential map. A pivot reduces the body to its rotation about that point: inertia of the parallel axis,
   centre of mass from the angle. Units: any consistent system, angles in rad.
   The state is replicated: every rank holds and advances all bodies, bit for bit the same, without communication.
   Does not know the flow (forces are written into the state by others), walls or contact. */
#include "compat.h"
#include "group.h"
#include "base/algebra.h"

#define CHUNK 256 /* points handled at a time on the stack */

struct _p_Bodies {
  BodyState   state;
  PetscReal   lower[3], upper[3]; /* domain */
  Placement **start;              /* [ngroups][count] what prescribed motion starts from; NULL for groups that have none */
};

/* ---- small tensor tools ---- */

/* Cramer's rule; A row-major, not singular (the caller's matrices are an inertia tensor plus a skew part) */
static void solve3(const PetscReal A[9], const PetscReal b[3], PetscReal x[3])
{
  PetscReal c0[3], c1[3], c2[3], det;

  cross(A + 3, A + 6, c0);
  cross(A + 6, A, c1);
  cross(A, A + 3, c2);
  det = A[0] * c0[0] + A[1] * c0[1] + A[2] * c0[2];
  for (PetscInt i = 0; i < 3; i++) x[i] = (c0[i] * b[0] + c1[i] * b[1] + c2[i] * b[2]) / det;
}

/* R t R^T */
static void rotate_tensor(const PetscReal q[4], const PetscReal t[6], PetscReal out[6])
{
  const PetscInt row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  PetscReal      R[9];

  RotationMatrix(q, R);
  for (PetscInt k = 0; k < 6; k++) {
    PetscReal tr[3];

    apply_tensor(t, R + 3 * col[k], tr); /* t times column col of R^T */
    out[k] = R[3 * row[k]] * tr[0] + R[3 * row[k] + 1] * tr[1] + R[3 * row[k] + 2] * tr[2];
  }
}

/* ---- what is not free ---- */

PetscBool BodiesIsFree(Bodies b, PetscInt k, PetscInt d)
{
  const PetscInt bit = d < 3 ? BODY_FREE_X << d : BODY_FREE_ROTATION;

  return (PetscBool)((b->state.group[b->state.body_group[k]].free & bit) && !(d == 3 && b->state.stopped[k]) && !b->state.gone[k]);
}

/* Nothing prescribed: the common case, which must cost nothing. The motion of a hole of the mesh is that of its boundary, which writes the state. */
static PetscBool nothing_known(Bodies b, PetscInt k)
{
  const PetscInt   all = BODY_FREE_X | BODY_FREE_Y | BODY_FREE_ROTATION | (b->state.dim == 3 ? BODY_FREE_Z : 0);
  const BodyGroup *g   = &b->state.group[b->state.body_group[k]];

  return (PetscBool)((g->free == all && !b->state.stopped[k]) || g->hole || b->state.gone[k]);
}

PetscErrorCode BodiesGetArm(Bodies b, PetscInt k, const PetscReal q[], PetscReal arm[3])
{
  const BodyGroup *g = &b->state.group[b->state.body_group[k]];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(arm, 3));
  if (g->motion.has_pivot) {
    PetscReal R[9];

    RotationMatrix(q ? q : b->state.q[k], R);
    for (PetscInt a = 0; a < 3; a++) arm[a] = R[3 * a] * g->arm[0] + R[3 * a + 1] * g->arm[1] + R[3 * a + 2] * g->arm[2];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const Placement *start_of(Bodies b, PetscInt k)
{
  const PetscInt g = b->state.body_group[k];

  return &b->start[g][k - b->state.group[g].first];
}

/* Orientation that is `turn` away from the start */
static void turn_from_start(Bodies b, PetscInt k, const PetscReal turn[3], PetscReal q[4], PetscReal *angle)
{
  *angle = start_of(b, k)->angle + turn[2];
  RotationFromAngle(b->state.dim == 2 ? *angle : start_of(b, k)->angle, q);
  if (b->state.dim == 3) RotationAdvance(1, turn, q);
}

PetscErrorCode BodiesGetKnownVelocity(Bodies b, PetscInt k, PetscReal time, PetscReal u[3], PetscReal w[3])
{
  const BodyState *s = &b->state;
  const BodyGroup *g = &s->group[s->body_group[k]];
  PetscReal        x[3], turn[3], uk[3], wk[3];

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(u, s->u[k], 3));
  PetscCall(PetscArraycpy(w, s->w[k], 3));
  if (nothing_known(b, k)) PetscFunctionReturn(PETSC_SUCCESS);
  MotionEvaluate(&g->motion, start_of(b, k), time, x, uk, turn, wk);
  for (PetscInt a = 0; a < 3; a++) {
    if (!BodiesIsFree(b, k, a)) u[a] = uk[a];
    if (!(g->free & BODY_FREE_ROTATION)) w[a] = wk[a];
    else if (s->stopped[k]) w[a] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Replace what is not free by its prescribed value at `time`, in x, q, angle and, if wanted, in u, w of the centre. Free translation is taken as it is. */
static PetscErrorCode place_known(Bodies b, PetscInt k, PetscReal time, PetscReal X[3], PetscReal q[4], PetscReal *angle, PetscReal u[],
                                  PetscReal w[])
{
  const BodyGroup *g = &b->state.group[b->state.body_group[k]];
  PetscReal        x[3], uk[3], turn[3], wk[3], arm[3], spin[3];

  PetscFunctionBeginUser;
  if (nothing_known(b, k)) PetscFunctionReturn(PETSC_SUCCESS);
  MotionEvaluate(&g->motion, start_of(b, k), time, x, uk, turn, wk);
  if (!(g->free & BODY_FREE_ROTATION)) {
    turn_from_start(b, k, turn, q, angle);
    if (w) PetscCall(PetscArraycpy(w, wk, 3));
  }
  PetscCall(BodiesGetArm(b, k, q, arm));
  if (u) cross(w, arm, spin);
  for (PetscInt a = 0; a < b->state.dim; a++) {
    if (BodiesIsFree(b, k, a)) continue;
    X[a] = x[a] + arm[a];
    if (u) u[a] = uk[a] + spin[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode apply_known(Bodies b, PetscInt k, PetscReal time)
{
  BodyState *s = &b->state;

  PetscFunctionBeginUser;
  PetscCall(place_known(b, k, time, s->x[k], s->q[k], &s->angle[k], s->u[k], s->w[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- creation ---- */

static PetscErrorCode create_state(BodyState *s)
{
  const PetscInt n = s->n;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(n, &s->body_group));
  PetscCall(PetscCalloc1(n, &s->x));
  PetscCall(PetscCalloc1(n, &s->q));
  PetscCall(PetscCalloc1(n, &s->angle));
  PetscCall(PetscCalloc1(n, &s->u));
  PetscCall(PetscCalloc1(n, &s->w));
  PetscCall(PetscCalloc1(n, &s->u_old));
  PetscCall(PetscCalloc1(n, &s->w_old));
  PetscCall(PetscCalloc1(n, &s->force));
  PetscCall(PetscCalloc1(n, &s->torque));
  PetscCall(PetscCalloc1(n, &s->contact_force));
  PetscCall(PetscCalloc1(n, &s->contact_torque));
  PetscCall(PetscCalloc1(n, &s->stopped));
  PetscCall(PetscCalloc1(n, &s->gap));
  PetscCall(PetscCalloc1(n, &s->gone));
  for (PetscInt k = 0; k < n; k++) s->gap[k] = PETSC_MAX_REAL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* First state: what is prescribed has the value of its motion at time 0. */
static PetscErrorCode store_start(Bodies b, PetscInt group, const Placement p[])
{
  BodyState       *s = &b->state;
  const BodyGroup *g = &s->group[group];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < g->count; i++) {
    const PetscInt k = g->first + i;

    s->body_group[k] = group;
    s->angle[k]      = p[i].angle;
    RotationFromAngle(p[i].angle, s->q[k]);
    for (PetscInt a = 0; a < 3; a++) {
      s->x[k][a] = p[i].x[a];
      s->u[k][a] = p[i].u[a];
      s->w[k][a] = p[i].omega[a];
    }
    PetscCheck(!g->motion.has_stops || (p[i].angle >= g->motion.stops[0] && p[i].angle <= g->motion.stops[1]), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Body %" PetscInt_FMT " of group '%s' starts at the angle %g, beyond -particle_%s_stops %g,%g", i, g->name, (double)p[i].angle,
               g->name, (double)g->motion.stops[0], (double)g->motion.stops[1]);
    PetscCall(apply_known(b, k, 0));
    PetscCall(PetscArraycpy(s->u_old[k], s->u[k], 3));
    PetscCall(PetscArraycpy(s->w_old[k], s->w[k], 3));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_domain(Bodies b)
{
  const BodyState *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt a = 0; a < s->dim; a++)
      PetscCheck(s->x[k][a] >= b->lower[a] && s->x[k][a] <= b->upper[a], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "Body %" PetscInt_FMT " of group '%s' starts outside the domain: coordinate %" PetscInt_FMT
                 " is %g, the domain is %g .. %g. Move the body (-particle_%s_*) or widen the mesh",
                 k - s->group[s->body_group[k]].first, s->group[s->body_group[k]].name, a, (double)s->x[k][a], (double)b->lower[a],
                 (double)b->upper[a], s->group[s->body_group[k]].name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_all_free(const BodyGroup *g, PetscInt dim)
{
  const PetscInt all = BODY_FREE_X | BODY_FREE_Y | (dim == 3 ? BODY_FREE_Z : 0) | BODY_FREE_ROTATION;

  return (PetscBool)((g->free & all) == all && !g->motion.has_stops && !g->motion.has_pivot);
}

PetscErrorCode BodiesCreate(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], Bodies *bodies)
{
  Bodies     b;
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCheck(dim == 2 || dim == 3, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Bodies of dimension %" PetscInt_FMT ": use 2 or 3", dim);
  PetscCall(PetscNew(&b));
  s      = &b->state;
  s->dim = dim;
  for (PetscInt a = 0; a < dim; a++) {
    b->lower[a] = lower[a];
    b->upper[a] = upper[a];
  }
  PetscCall(BodyGroupsRead(s, b->lower, b->upper, &b->start));
  PetscCall(create_state(s));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(store_start(b, g, b->start[g]));
    if (is_all_free(&s->group[g], dim)) PetscCall(PetscFree(b->start[g])); /* a million of them would count */
  }
  PetscCall(check_domain(b));
  *bodies = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesDestroy(Bodies *bodies)
{
  BodyState *s;

  PetscFunctionBeginUser;
  if (!*bodies) PetscFunctionReturn(PETSC_SUCCESS);
  s = &(*bodies)->state;
  for (PetscInt g = 0; g < s->ngroups; g++) PetscCall(ShapeDestroy(&s->group[g].shape));
  PetscCall(PetscFree(s->group));
  PetscCall(PetscFree(s->body_group));
  PetscCall(PetscFree(s->x));
  PetscCall(PetscFree(s->q));
  PetscCall(PetscFree(s->angle));
  PetscCall(PetscFree(s->u));
  PetscCall(PetscFree(s->w));
  PetscCall(PetscFree(s->u_old));
  PetscCall(PetscFree(s->w_old));
  PetscCall(PetscFree(s->force));
  PetscCall(PetscFree(s->torque));
  PetscCall(PetscFree(s->contact_force));
  PetscCall(PetscFree(s->contact_torque));
  PetscCall(PetscFree(s->stopped));
  PetscCall(PetscFree(s->gap));
  PetscCall(PetscFree(s->gone));
  for (PetscInt g = 0; g < s->ngroups; g++) PetscCall(PetscFree((*bodies)->start[g]));
  PetscCall(PetscFree((*bodies)->start));
  PetscCall(PetscFree(*bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesView(Bodies b, PetscViewer viewer)
{
  const BodyState *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const BodyGroup *group = &s->group[g];
    const char      *type;

    PetscCall(ShapeGetType(group->shape, &type));
    PetscCall(PetscViewerASCIIPrintf(viewer, "group %s: %" PetscInt_FMT " x %s, density %g, %s %g, bounding radius %g, free:%s%s%s%s%s\n",
                                     group->name, group->count, type, (double)group->density, s->dim == 2 ? "area" : "volume",
                                     (double)group->mass.volume, (double)group->radius, group->free & BODY_FREE_X ? " x" : "",
                                     group->free & BODY_FREE_Y ? " y" : "", group->free & BODY_FREE_Z ? " z" : "",
                                     group->free & BODY_FREE_ROTATION ? " rotation" : "", group->free ? "" : " none"));
    if (group->motion.has_pivot)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  turns about a pivot at distance %g from its centre of mass\n",
                                       (double)PetscSqrtReal(PetscSqr(group->arm[0]) + PetscSqr(group->arm[1]) + PetscSqr(group->arm[2]))));
    if (group->motion.has_stops)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  stops at the angles %g and %g, restitution %g\n", (double)group->motion.stops[0],
                                       (double)group->motion.stops[1], (double)group->motion.restitution));
    if (group->motion.given)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  prescribed motion:%s%s%s, ramp %g\n", group->motion.constant ? " constant" : "",
                                       group->motion.rotate ? " rotate" : "",
                                       MotionOscillates(&group->motion, 0) || MotionOscillates(&group->motion, 1) ||
                                           MotionOscillates(&group->motion, 2) || MotionOscillates(&group->motion, 3)
                                         ? " oscillate"
                                         : "",
                                       (double)group->motion.ramp));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions ---- */

static PetscErrorCode check_body(Bodies b, PetscInt k)
{
  PetscFunctionBeginUser;
  PetscCheck(k >= 0 && k < b->state.n, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Body %" PetscInt_FMT " does not exist: there are %" PetscInt_FMT,
             k, b->state.n);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetState(Bodies b, BodyState **state)
{
  PetscFunctionBeginUser;
  *state = &b->state;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetVolume(Bodies b, PetscInt k, PetscReal *volume)
{
  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  *volume = b->state.group[b->state.body_group[k]].mass.volume;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetInertia(Bodies b, PetscInt k, PetscBool per_density, PetscReal inertia[6])
{
  const BodyGroup *g;
  PetscReal        scale;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g     = &b->state.group[b->state.body_group[k]];
  scale = per_density ? 1 : g->density;
  PetscCall(PetscArrayzero(inertia, 6));
  if (b->state.dim == 2) inertia[2] = g->mass.inertia[2];
  else rotate_tensor(b->state.q[k], g->mass.inertia, inertia);
  for (PetscInt i = 0; i < 6; i++) inertia[i] *= scale;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetEnergy(Bodies b, PetscReal *energy)
{
  const BodyState *s = &b->state;

  PetscFunctionBeginUser;
  *energy = 0;
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = &s->group[s->body_group[k]];
    PetscReal        inertia[6], L[3];

    if (s->gone[k]) continue;
    if (s->dim == 2) {
      *energy += 0.5 * g->density * (g->mass.volume * (PetscSqr(s->u[k][0]) + PetscSqr(s->u[k][1])) + g->mass.inertia[2] * PetscSqr(s->w[k][2]));
      continue;
    }
    PetscCall(BodiesGetInertia(b, k, PETSC_FALSE, inertia));
    apply_tensor(inertia, s->w[k], L);
    for (PetscInt a = 0; a < 3; a++) *energy += 0.5 * (g->density * g->mass.volume * PetscSqr(s->u[k][a]) + s->w[k][a] * L[a]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points x [n][dim] in the frame of a body of group g at X, turned by R */
static void into_frame(const BodyGroup *g, PetscInt dim, const PetscReal X[], const PetscReal R[9], PetscInt n, const PetscReal x[], PetscReal y[])
{
  for (PetscInt p = 0; p < n; p++) {
    const PetscReal *xp   = x + p * dim;
    const PetscReal  r[3] = {xp[0] - X[0], xp[1] - X[1], dim == 3 ? xp[2] - X[2] : 0};

    for (PetscInt a = 0; a < dim; a++) y[p * dim + a] = R[a] * r[0] + R[3 + a] * r[1] + R[6 + a] * r[2] + g->mass.centroid[a];
  }
}

PetscErrorCode BodiesDistance(Bodies b, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt n, const PetscReal x[], PetscReal d[])
{
  const PetscInt   dim = b->state.dim;
  const BodyGroup *g;
  PetscReal        R[9], y[CHUNK * 3];

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g = &b->state.group[b->state.body_group[k]];
  if (!X) X = b->state.x[k];
  RotationMatrix(q ? q : b->state.q[k], R);
  for (PetscInt start = 0; start < n; start += CHUNK) {
    const PetscInt m = PetscMin(CHUNK, n - start);

    into_frame(g, dim, X, R, m, x + start * dim, y);
    PetscCall(ShapeDistance(g->shape, m, y, d + start));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesProject(Bodies b, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt n, const PetscReal x[], PetscReal y[])
{
  const PetscInt   dim = b->state.dim;
  const BodyGroup *g;
  PetscReal        R[9], local[CHUNK * 3], wall[CHUNK * 3];

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g = &b->state.group[b->state.body_group[k]];
  if (!X) X = b->state.x[k];
  RotationMatrix(q ? q : b->state.q[k], R);
  for (PetscInt start = 0; start < n; start += CHUNK) {
    const PetscInt m = PetscMin(CHUNK, n - start);

    into_frame(g, dim, X, R, m, x + start * dim, local);
    PetscCall(ShapeProject(g->shape, m, local, wall));
    for (PetscInt p = 0; p < m; p++) {
      PetscReal r[3] = {0, 0, 0};

      for (PetscInt a = 0; a < dim; a++) r[a] = wall[p * dim + a] - g->mass.centroid[a];
      for (PetscInt a = 0; a < dim; a++) y[(start + p) * dim + a] = X[a] + R[3 * a] * r[0] + R[3 * a + 1] * r[1] + R[3 * a + 2] * r[2];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- motion ---- */

/* I (w' - w)/dt + m x (I m) = T with m = (w + w')/2, for w'. Newton's method; starts from w, converges in 3 to 5 steps. */
static void advance_spin(PetscReal dt, const PetscReal inertia[6], const PetscReal T[3], PetscReal w[3])
{
  const PetscReal w0[3] = {w[0], w[1], w[2]};

  for (PetscInt it = 0; it < 20; it++) {
    PetscReal m[3], Im[3], gyro[3], dw[3], Idw[3], r[3], J[9], e[3], size = 0, change = 0;

    for (PetscInt a = 0; a < 3; a++) {
      m[a]  = 0.5 * (w0[a] + w[a]);
      dw[a] = w[a] - w0[a];
    }
    apply_tensor(inertia, m, Im);
    apply_tensor(inertia, dw, Idw);
    cross(m, Im, gyro);
    for (PetscInt a = 0; a < 3; a++) r[a] = dt * T[a] - Idw[a] - dt * gyro[a];
    /* column c of the derivative: inertia e + dt/2 (e x inertia m + m x inertia e) */
    for (PetscInt c = 0; c < 3; c++) {
      const PetscReal unit[3] = {c == 0, c == 1, c == 2};
      PetscReal       Ie[3], a1[3], a2[3];

      apply_tensor(inertia, unit, Ie);
      cross(unit, Im, a1);
      cross(m, Ie, a2);
      for (PetscInt a = 0; a < 3; a++) J[3 * a + c] = Ie[a] + 0.5 * dt * (a1[a] + a2[a]);
    }
    solve3(J, r, e);
    for (PetscInt a = 0; a < 3; a++) {
      w[a] += e[a];
      size   = PetscMax(size, PetscAbsReal(w[a]));
      change = PetscMax(change, PetscAbsReal(e[a]));
    }
    if (change <= 4 * PETSC_MACHINE_EPSILON * size) break;
  }
}

PetscErrorCode BodiesGetLoad(Bodies b, PetscInt k, PetscReal rho_f, const PetscReal gravity[3], PetscReal force[3], PetscReal torque[3])
{
  const BodyGroup *g;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g = &b->state.group[b->state.body_group[k]];
  for (PetscInt a = 0; a < 3; a++) {
    force[a]  = g->motion.force[a] + (g->density - rho_f) * g->mass.volume * (a < b->state.dim ? gravity[a] : 0);
    torque[a] = g->motion.torque[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetTorque(Bodies b, PetscInt k, PetscReal rho_f, const PetscReal gravity[3], PetscReal torque[3])
{
  const BodyState *s = &b->state;
  PetscReal        force[3], arm[3], moment[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetLoad(b, k, rho_f, gravity, force, torque));
  PetscCall(BodiesGetArm(b, k, NULL, arm));
  for (PetscInt a = 0; a < 3; a++) force[a] += s->force[k][a] + s->contact_force[k][a];
  cross(arm, force, moment);
  for (PetscInt a = 0; a < 3; a++) torque[a] += s->torque[k][a] + s->contact_torque[k][a] + moment[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesRelease(Bodies b, PetscInt k, PetscReal rho_f, const PetscReal gravity[3])
{
  PetscReal T[3];

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  if (!b->state.stopped[k]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesGetTorque(b, k, rho_f, gravity, T));
  if (T[2] * b->state.stopped[k] < 0) b->state.stopped[k] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inertia about the reference point: I + M (arm^2 1 - arm arm^T) */
static PetscErrorCode reference_inertia(Bodies b, PetscInt k, PetscReal inertia[6])
{
  const PetscInt   row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  const BodyGroup *g = &b->state.group[b->state.body_group[k]];
  PetscReal        arm[3], square;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetInertia(b, k, PETSC_FALSE, inertia));
  PetscCall(BodiesGetArm(b, k, NULL, arm));
  square = arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2];
  for (PetscInt i = 0; i < 6; i++) inertia[i] += g->density * g->mass.volume * ((row[i] == col[i] ? square : 0) - arm[row[i]] * arm[col[i]]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The reference point is the centre or moves with constant velocity; the inertial force of a pivot that is accelerated, -M a, acts at the centre. */
static PetscErrorCode advance_rotation(Bodies b, PetscInt k, PetscReal dt, PetscReal rho_f, const PetscReal gravity[3])
{
  BodyState       *s = &b->state;
  const BodyGroup *g = &s->group[s->body_group[k]];
  PetscReal        inertia[6], T[3], arm[3], u[2][3], w[3], a[3], moment[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetTorque(b, k, rho_f, gravity, T));
  PetscCall(reference_inertia(b, k, inertia));
  if (g->motion.has_pivot) {
    PetscCall(BodiesGetArm(b, k, NULL, arm));
    PetscCall(BodiesGetKnownVelocity(b, k, s->time, u[0], w));
    PetscCall(BodiesGetKnownVelocity(b, k, s->time + dt, u[1], w));
    for (PetscInt d = 0; d < 3; d++) a[d] = -g->density * g->mass.volume * (u[1][d] - u[0][d]) / dt;
    cross(arm, a, moment);
    for (PetscInt d = 0; d < 3; d++) T[d] += moment[d];
  }
  if (s->dim == 2) s->w[k][2] += dt * T[2] / inertia[2];
  else advance_spin(dt, inertia, T, s->w[k]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAdvanceVelocity(Bodies b, PetscReal dt, PetscReal rho_f, const PetscReal gravity[3])
{
  BodyState *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g    = &s->group[s->body_group[k]];
    const PetscReal  mass = g->density * g->mass.volume;
    PetscReal        force[3], torque[3], u[3], w[3], spin[3], arm[3];

    PetscCall(PetscArraycpy(s->u_old[k], s->u[k], 3));
    PetscCall(PetscArraycpy(s->w_old[k], s->w[k], 3));
    PetscCall(BodiesGetLoad(b, k, rho_f, gravity, force, torque));
    for (PetscInt a = 0; a < s->dim; a++)
      if (BodiesIsFree(b, k, a)) s->u[k][a] += dt * (s->force[k][a] + s->contact_force[k][a] + force[a]) / mass;
    PetscCall(BodiesRelease(b, k, rho_f, gravity));
    if (BodiesIsFree(b, k, 3)) PetscCall(advance_rotation(b, k, dt, rho_f, gravity));
    PetscCall(BodiesGetKnownVelocity(b, k, s->time + dt, u, w));
    PetscCall(BodiesGetArm(b, k, NULL, arm));
    cross(w, arm, spin);
    for (PetscInt a = 0; a < 3; a++) {
      if (a < s->dim && !BodiesIsFree(b, k, a)) s->u[k][a] = u[a] + spin[a];
      s->w[k][a] = w[a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The rebound of a body that has passed a stop (see bodies.h) */
static void keep_stops(BodyState *s, PetscInt k, PetscReal dt)
{
  const Motion   *m = &s->group[s->body_group[k]].motion;
  PetscReal      *w = &s->w[k][2], *w_old = &s->w_old[k][2];
  const PetscInt  side = s->angle[k] >= m->stops[1] ? 1 : s->angle[k] <= m->stops[0] ? -1 : 0;
  const PetscReal stop = m->stops[side > 0], speed = side * *w, gain = side * (*w - *w_old);

  if (!m->has_stops || !side) return;
  if (speed <= 0) { /* has turned round by itself within the step */
    s->angle[k] = stop;
  } else if (m->restitution * speed <= 2 * PetscAbsReal(gain) || m->restitution == 0) {
    s->angle[k]   = stop;
    s->stopped[k] = side;
    *w = *w_old = 0;
  } else {
    const PetscReal jump = (1 + m->restitution) * *w;

    s->angle[k] = stop - PetscMin(m->restitution * PetscAbsReal(s->angle[k] - stop), dt * speed) * side;
    *w -= jump;
    *w_old -= jump;
  }
}

PetscErrorCode BodiesAdvancePosition(Bodies b, PetscReal dt, PetscReal theta)
{
  BodyState *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal w[3];

    for (PetscInt a = 0; a < 3; a++) {
      if (a < s->dim) s->x[k][a] += dt * (theta * s->u[k][a] + (1 - theta) * s->u_old[k][a]);
      w[a] = theta * s->w[k][a] + (1 - theta) * s->w_old[k][a];
    }
    s->angle[k] += dt * w[2];
    keep_stops(s, k, dt);
    if (s->dim == 2) RotationFromAngle(s->angle[k], s->q[k]);
    else RotationAdvance(dt, w, s->q[k]);
    PetscCall(apply_known(b, k, s->time + dt));
    for (PetscInt a = 0; a < s->dim; a++)
      PetscCheck(!PetscIsInfOrNanReal(s->x[k][a]) && !PetscIsInfOrNanReal(s->angle[k]), PETSC_COMM_SELF, PETSC_ERR_FP,
                 "Body %" PetscInt_FMT " of group '%s' has left all bounds (velocity %g): lower -sim_dt", k - s->group[s->body_group[k]].first,
                 s->group[s->body_group[k]].name, (double)s->u[k][a]);
  }
  s->time += dt;
  s->dt_old = dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAreStill(Bodies b, PetscBool *still)
{
  PetscFunctionBeginUser;
  *still = PETSC_TRUE;
  for (PetscInt g = 0; g < b->state.ngroups; g++) *still = (PetscBool)(*still && !b->state.group[g].free && !b->state.group[g].motion.given);
  for (PetscInt i = 0; i < 3 * b->state.n && *still; i++) *still = (PetscBool)(b->state.u[i / 3][i % 3] == 0 && b->state.w[i / 3][i % 3] == 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal BodiesFastestPoint(const BodyState *s, PetscInt k, PetscReal r)
{
  const BodyGroup *g = &s->group[s->body_group[k]];
  PetscReal        u = 0, w = 0;

  for (PetscInt d = 0; d < 3; d++) {
    u += PetscSqr(s->u[k][d] + r * (s->u[k][d] - s->u_old[k][d]));
    w += PetscSqr(s->w[k][d] + r * (s->w[k][d] - s->w_old[k][d]));
  }
  return PetscSqrtReal(u) + (g->disc > 0 ? 0 : g->radius * PetscSqrtReal(w));
}

PetscErrorCode BodiesPredict(Bodies b, PetscInt k, PetscReal dt, PetscInt order, PetscReal X[3], PetscReal q[4], PetscReal *angle)
{
  const BodyState *s = &b->state;
  const Motion    *m;
  PetscReal        w[3], now, old;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  PetscCheck(order >= 0 && order <= 2, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Prediction of order %" PetscInt_FMT ": use 0, 1 or 2", order);
  m   = &s->group[s->body_group[k]].motion;
  old = order == 2 ? -0.5 * (s->dt_old > 0 ? dt / s->dt_old : 1) : 0;
  now = PetscMin(order, 1) - old;
  for (PetscInt a = 0; a < 3; a++) {
    X[a] = s->x[k][a] + dt * (now * s->u[k][a] + old * s->u_old[k][a]);
    w[a] = now * s->w[k][a] + old * s->w_old[k][a];
  }
  *angle = s->angle[k] + dt * w[2];
  if (m->has_stops) *angle = PetscMin(PetscMax(*angle, m->stops[0]), m->stops[1]);
  PetscCall(PetscArraycpy(q, s->q[k], 4));
  if (s->dim == 2) RotationFromAngle(*angle, q);
  else RotationAdvance(dt, w, q);
  PetscCall(place_known(b, k, s->time + dt, X, q, angle, NULL, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- state ---- */

/* The bodies of the file must be those of the scene: name, number, volume and inertia of every group */
static PetscErrorCode visit_groups(const BodyState *s, State state)
{
  PetscInt   count[BODIES_MAX_GROUPS];
  PetscReal  measure[BODIES_MAX_GROUPS][2];
  char       list[BODIES_MAX_GROUPS * (sizeof(s->group->name) + 1)] = "", *names = list;
  PetscReal *flat = &measure[0][0];

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(PetscStrlcat(list, g ? " " : "", sizeof(list)));
    PetscCall(PetscStrlcat(list, s->group[g].name, sizeof(list)));
    count[g]      = s->group[g].count;
    measure[g][0] = s->group[g].mass.volume;
    measure[g][1] = s->group[g].mass.inertia[2];
  }
  PetscCall(StateText(state, "groups", &names));
  if (StateIsLoading(state)) {
    PetscCheck(!strcmp(names, list), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "The checkpoint has the groups of bodies '%s', this scene '%s': restart with the same -particle_groups", names, list);
    PetscCall(PetscFree(names));
  }
  PetscCall(StateInts(state, "count", s->ngroups, count));
  PetscCall(StateReals(state, "measure", 2 * s->ngroups, flat));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const BodyGroup *group   = s->group + g;
    const PetscReal  mine[2] = {group->mass.volume, group->mass.inertia[2]};

    PetscCheck(count[g] == group->count, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "The checkpoint has %" PetscInt_FMT " bodies of group '%s', this scene %" PetscInt_FMT
               ": restart with the options of the run that wrote it",
               count[g], group->name, group->count);
    for (PetscInt i = 0; i < 2; i++)
      PetscCheck(PetscAbsReal(mine[i] - measure[g][i]) <= 1e-9 * PetscAbsReal(measure[g][i]), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
                 "The bodies of group '%s' have another shape than in the checkpoint (%s %g, there %g): restart with the options -particle_%s_* of the run that "
                 "wrote it",
                 group->name, i ? "second moment" : "volume", (double)mine[i], (double)measure[g][i], group->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesVisitState(void *bodies, State state)
{
  BodyState *s = &((Bodies)bodies)->state;
  PetscInt  *gone;

  PetscFunctionBeginUser;
  PetscCall(visit_groups(s, state));
  PetscCall(StateReals(state, "dt_old", 1, &s->dt_old));
  PetscCall(StateReals(state, "x", 3 * s->n, (PetscReal *)s->x));
  PetscCall(StateReals(state, "q", 4 * s->n, (PetscReal *)s->q));
  PetscCall(StateReals(state, "angle", s->n, s->angle));
  PetscCall(StateReals(state, "u", 3 * s->n, (PetscReal *)s->u));
  PetscCall(StateReals(state, "w", 3 * s->n, (PetscReal *)s->w));
  PetscCall(StateReals(state, "u_old", 3 * s->n, (PetscReal *)s->u_old));
  PetscCall(StateReals(state, "w_old", 3 * s->n, (PetscReal *)s->w_old));
  PetscCall(StateReals(state, "force", 3 * s->n, (PetscReal *)s->force));
  PetscCall(StateReals(state, "torque", 3 * s->n, (PetscReal *)s->torque));
  PetscCall(StateReals(state, "contact_force", 3 * s->n, (PetscReal *)s->contact_force));
  PetscCall(StateReals(state, "contact_torque", 3 * s->n, (PetscReal *)s->contact_torque));
  PetscCall(StateReals(state, "gap", s->n, s->gap));
  PetscCall(StateReals(state, "time", 1, &s->time));
  PetscCall(StateInts(state, "stopped", s->n, s->stopped));
  PetscCall(PetscMalloc1(s->n, &gone));
  for (PetscInt k = 0; k < s->n; k++) gone[k] = s->gone[k];
  PetscCall(StateInts(state, "gone", s->n, gone));
  for (PetscInt k = 0; k < s->n; k++) s->gone[k] = (PetscBool)gone[k];
  PetscCall(PetscFree(gone));
  PetscFunctionReturn(PETSC_SUCCESS);
}
