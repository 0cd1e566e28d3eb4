/* Bodies: made, viewed, visited; see bodies.h. What can be asked of them is in state.c, how they move in advance.c,
   the options of the groups in group.c.

   Every rank holds and advances the bodies that it knows (local.h), bit for bit the same as others, without
   communication. Does not know the flow (forces are written into the state by others), walls or contact. */
#include "compat.h"
#include "base/runcomm.h"
#include "impl.h"
#include "bodies/slip.h"
#include "joint.h"
#include "base/algebra.h"
#include "bodies/local.h"

/* ---- creation ---- */

/* The arrays of numbers in the state, in the order of checkpoints */
static const struct {
  const char *name;
  size_t      offset;
  PetscInt    width;
} FIELDS[] = {{"x", offsetof(BodyArrays, x), 3},
              {"q", offsetof(BodyArrays, q), 4},
              {"q_old", offsetof(BodyArrays, q_old), 4},
              {"angle", offsetof(BodyArrays, angle), 1},
              {"u", offsetof(BodyArrays, u), 3},
              {"w", offsetof(BodyArrays, w), 3},
              {"u_old", offsetof(BodyArrays, u_old), 3},
              {"w_old", offsetof(BodyArrays, w_old), 3},
              {"force", offsetof(BodyArrays, force), 3},
              {"torque", offsetof(BodyArrays, torque), 3},
              {"contact_force", offsetof(BodyArrays, contact_force), 3},
              {"contact_torque", offsetof(BodyArrays, contact_torque), 3},
              {"gap", offsetof(BodyArrays, gap), 1}};
enum {
  NFIELDS = sizeof(FIELDS) / sizeof(FIELDS[0])
};

static void **field(BodyArrays *s, PetscInt f)
{
  return (void **)((char *)s + FIELDS[f].offset);
}

static PetscErrorCode create_columns(Bodies b)
{
  BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  PetscCall(BodyAddColumn(b, sizeof(PetscInt), PETSC_FALSE, (void **)&s->number));
  for (PetscInt f = 0; f < NFIELDS; f++)
    PetscCall(BodyAddColumn(b, FIELDS[f].width * sizeof(PetscReal), PETSC_FALSE, field(s, f)));
  PetscCall(BodyAddColumn(b, sizeof(PetscReal), PETSC_FALSE, (void **)&s->scale));
  PetscCall(BodyAddColumn(b, sizeof(PetscReal), PETSC_FALSE, (void **)&s->density));
  PetscCall(BodyAddColumn(b, sizeof(PetscReal), PETSC_FALSE, (void **)&s->lighter));
  PetscCall(BodyAddColumn(b, sizeof(PetscInt), PETSC_FALSE, (void **)&s->body_group));
  PetscCall(BodyAddColumn(b, sizeof(PetscInt), PETSC_FALSE, (void **)&s->stopped));
  PetscCall(BodyAddColumn(b, sizeof(PetscBool), PETSC_FALSE, (void **)&s->removed));
  PetscCall(BodyAddColumn(b, sizeof(PetscBool), PETSC_FALSE, (void **)&s->own));
  PetscCall(BodyAddColumn(b, sizeof(PetscReal), PETSC_FALSE, (void **)&b->left));
  if (!b->subdomains) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodyAddColumn(b, sizeof(PetscMPIInt), PETSC_FALSE, (void **)&b->owner));
  PetscCall(BodyAddColumn(b, sizeof(PetscInt), PETSC_FALSE, (void **)&b->home));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* First state: what is prescribed has the value of its motion at time 0. */
static PetscErrorCode store_start(Bodies b, PetscInt group, const Placed *placed)
{
  BodyArrays      *s = &b->state;
  const BodyGroup *g = &s->group[group];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < placed->n; i++) {
    const Placement *p = placed->body + i;
    const PetscInt   k = s->n;

    if (!placed->number && !BodySubdomainsOwn(b->subdomains, p->x)) continue;
    s->n++;
    s->number[k]     = g->first + (placed->number ? placed->number[i] : i);
    s->own[k]        = PETSC_TRUE;
    s->gap[k]        = PETSC_MAX_REAL;
    b->left[k]       = -PETSC_MAX_REAL;
    s->body_group[k] = group;
    s->scale[k]      = p->scale;
    s->density[k]    = p->density;
    s->lighter[k]    = 0;
    s->angle[k]      = p->angle;
    if (p->turned) PetscCall(PetscArraycpy(s->q[k], p->q, 4));
    else RotationFromAngle(p->angle, s->q[k]);
    PetscCall(PetscArraycpy(s->q_old[k], s->q[k], 4));
    for (PetscInt a = 0; a < 3; a++) {
      s->x[k][a] = p->x[a];
      s->u[k][a] = p->u[a];
      s->w[k][a] = p->omega[a];
    }
    PetscCheck(!g->motion.has_stops || (p->angle >= g->motion.stops[0] && p->angle <= g->motion.stops[1]),
               PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Body %" PetscInt_FMT " of group '%s' starts at the angle %g, beyond -particle_%s_stops %g,%g",
               s->number[k] - g->first, g->name, (double)p->angle, g->name, (double)g->motion.stops[0],
               (double)g->motion.stops[1]);
    PetscCall(BodiesApplyPrescribed(b, k, 0));
    BodiesKeepAxes(&b->view, k, s->u[k], s->w[k]);
    PetscCall(PetscArraycpy(s->u_old[k], s->u[k], 3));
    PetscCall(PetscArraycpy(s->w_old[k], s->w[k], 3));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_domain(Bodies b)
{
  const BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt a = 0; a < s->dim && !BodiesGetGroup(&b->view, k)->obstacle; a++)
      PetscCheck(s->x[k][a] >= b->lower[a] && s->x[k][a] <= b->upper[a], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "Body %" PetscInt_FMT
                 " of group '%s' starts outside the domain: its %c is %g, the domain goes from %g to %g: move the body (-particle_%s_*), widen the mesh, or "
                 "make it an obstacle (-particle_%s_obstacle)",
                 BodiesIndexInGroup(&b->view, k), BodiesGetGroup(&b->view, k)->name, 'x' + (int)a, (double)s->x[k][a],
                 (double)b->lower[a], (double)b->upper[a], BodiesGetGroup(&b->view, k)->name,
                 BodiesGetGroup(&b->view, k)->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bodies that this rank will hold, at least */
static PetscInt count_placed(Bodies b, const Placed placed[])
{
  PetscInt n = 0;

  for (PetscInt g = 0; g < b->state.ngroups; g++)
    for (PetscInt i = 0; i < placed[g].n; i++)
      n += placed[g].number || BodySubdomainsOwn(b->subdomains, placed[g].body[i].x);
  return n;
}

/* Takes the sub-domains over */
static PetscErrorCode create_bodies(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                    BodySubdomains *subdomains, Bodies *bodies)
{
  Bodies      b;
  BodyArrays *s;
  Placed     *placed;

  PetscFunctionBeginUser;
  PetscCheck(dim == 2 || dim == 3, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Bodies of dimension %" PetscInt_FMT ": use 2 or 3", dim);
  PetscCall(PetscNew(&b));
  b->subdomains = subdomains;
  s             = &b->state;
  s->dim        = dim;
  for (PetscInt a = 0; a < dim; a++) {
    b->lower[a] = lower[a];
    b->upper[a] = upper[a];
  }
  PetscCall(BodyGroupsRead(s, subdomains, b->lower, b->upper, &placed));
  b->capacity = count_placed(b, placed);
  PetscCall(create_columns(b));
  PetscCall(PetscCalloc1(s->ngroups, &b->start));
  PetscCall(PetscCalloc1(s->ngroups, &b->clock));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    b->start[g] = placed[g].body;
    PetscCall(store_start(b, g, &placed[g]));
    if (BodyIsAllFree(&s->group[g], dim)) PetscCall(PetscFree(b->start[g])); /* a million of them would count */
    PetscCall(PetscFree(placed[g].number));
  }
  PetscCall(PetscFree(placed));
  PetscCall(check_domain(b));
  *bodies = b;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesCreate(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], Bodies *bodies)
{
  PetscFunctionBeginUser;
  PetscCall(create_bodies(dim, lower, upper, NULL, bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesCreateLocal(MPI_Comm comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                 const PetscReal period[3], Bodies *bodies)
{
  BodySubdomains *subdomains = NULL;
  PetscMPIInt     size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  if (size > 1) PetscCall(BodySubdomainsCreate(comm, dim, lower, upper, period, &subdomains));
  PetscCall(create_bodies(dim, lower, upper, subdomains, bodies));
  for (PetscInt a = 0; a < dim; a++) (*bodies)->box[a] = period[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesDestroy(Bodies *bodies)
{
  BodyArrays *s;

  PetscFunctionBeginUser;
  if (!*bodies) PetscFunctionReturn(PETSC_SUCCESS);
  s = &(*bodies)->state;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(ShapeDestroy(&s->group[g].shape));
    PetscCall(MotionDestroy(&s->group[g].motion));
    PetscCall(BodySlipDestroy(&s->group[g].slip));
  }
  PetscCall(PetscFree(s->group));
  for (PetscInt i = 0; i < (*bodies)->ncolumns; i++) PetscCall(PetscFree(*(*bodies)->column[i].array));
  PetscCall(BodySubdomainsDestroy(&(*bodies)->subdomains));
  for (PetscInt g = 0; g < s->ngroups; g++) PetscCall(PetscFree((*bodies)->start[g]));
  PetscCall(PetscFree((*bodies)->start));
  PetscCall(PetscFree((*bodies)->clock));
  PetscCall(PetscFree(*bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sizes and densities of a group whose bodies differ */
static PetscErrorCode view_spread(Bodies b, const BodyGroup *g, PetscViewer viewer)
{
  const BodyArrays *s    = &b->state;
  PetscReal         v[4] = {-PETSC_MAX_REAL, 0, -PETSC_MAX_REAL, 0}; /* - smallest, largest size; likewise density */

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal now[4] = {-s->scale[k], s->scale[k], -s->density[k], s->density[k]};

    for (PetscInt i = 0; i < 4 && BodiesGetGroup(&b->view, k) == g; i++) v[i] = PetscMax(v[i], now[i]);
  }
  PetscCall(BodiesMax(b, 4, v));
  if (g->count && (v[0] != -1 || v[1] != 1 || v[2] != -g->density || v[3] != g->density))
    PetscCall(PetscViewerASCIIPrintf(viewer, "  sizes %g to %g of the shape's, densities %g to %g\n", (double)-v[0],
                                     (double)v[1], (double)-v[2], (double)v[3]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the centres of mass of a group are: of one body, or the box around those of several */
static PetscErrorCode view_position(Bodies b, const BodyGroup *g, PetscViewer viewer)
{
  const BodyArrays *s    = &b->state;
  PetscReal         v[6] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL,
                            -PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    for (PetscInt d = 0; d < s->dim && BodiesGetGroup(&b->view, k) == g; d++) {
      v[d]     = PetscMax(v[d], -s->x[k][d]);
      v[3 + d] = PetscMax(v[3 + d], s->x[k][d]);
    }
  }
  PetscCall(BodiesMax(b, 6, v));
  if (!g->count) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscViewerASCIIPrintf(viewer, g->count == 1 ? "  centre of mass at " : "  centres of mass in "));
  for (PetscInt d = 0; d < s->dim; d++) {
    if (g->count == 1) PetscCall(PetscViewerASCIIPrintf(viewer, "%s%g", d ? ", " : "", (double)v[3 + d]));
    else PetscCall(PetscViewerASCIIPrintf(viewer, "%s[%g, %g]", d ? " x " : "", (double)-v[d], (double)v[3 + d]));
  }
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesView(Bodies b, PetscViewer viewer)
{
  const BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const BodyGroup *group = &s->group[g];
    const char      *type;
    PetscBool        file;

    PetscCall(ShapeGetType(group->shape, &type));
    PetscCall(PetscViewerASCIIPrintf(viewer,
                                     "group %s: %" PetscInt_FMT
                                     " x %s, density %g, %s %g, bounding radius %g, free:%s%s%s%s%s\n",
                                     group->name, group->count, type, (double)group->density,
                                     s->dim == 2 ? "area" : "volume", (double)group->mass.volume, (double)group->radius,
                                     group->free & BODY_FREE_X ? " x" : "", group->free & BODY_FREE_Y ? " y" : "",
                                     group->free & BODY_FREE_Z ? " z" : "",
                                     group->free & BODY_FREE_ROTATION ? " rotation" : "", group->free ? "" : " none"));
    PetscCall(ShapeIsFromFile(group->shape, &file));
    if (file) {
      PetscCall(PetscViewerASCIIPrintf(viewer, "  "));
      PetscCall(ShapeDescribe(group->shape, viewer));
    }
    PetscCall(view_spread(b, group, viewer));
    PetscCall(view_position(b, group, viewer));
    if (group->motion.has_pivot)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  turns about a pivot at distance %g from its centre of mass\n",
                                       (double)PetscSqrtReal(PetscSqr(group->arm[0]) + PetscSqr(group->arm[1]) +
                                                             PetscSqr(group->arm[2]))));
    if (group->motion.has_hinge)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  turns about the axis (%g, %g, %g) only\n",
                                       (double)group->motion.hinge[0], (double)group->motion.hinge[1],
                                       (double)group->motion.hinge[2]));
    if (group->motion.has_slide)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  slides along (%g, %g, %g) only\n", (double)group->motion.slide[0],
                                       (double)group->motion.slide[1], (double)group->motion.slide[2]));
    PetscCall(JointView(&group->motion, viewer));
    if (group->obstacle)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  an obstacle: may overlap walls and other obstacles\n"));
    if (group->motion.has_stops)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  stops at the angles %g and %g, restitution %g\n",
                                       (double)group->motion.stops[0], (double)group->motion.stops[1],
                                       (double)group->motion.restitution));
    if (group->motion.given)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  prescribed motion:%s%s%s, ramp %g\n",
                                       group->motion.constant ? " constant" : "", group->motion.rotate ? " rotate" : "",
                                       MotionOscillates(&group->motion, 0) || MotionOscillates(&group->motion, 1) ||
                                           MotionOscillates(&group->motion, 2) || MotionOscillates(&group->motion, 3)
                                         ? " oscillate"
                                         : "",
                                       (double)group->motion.ramp));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions ---- */

PetscErrorCode BodiesSetInitialPositions(Bodies b, PetscInt k, const PetscReal x[3], const PetscReal q[4],
                                         PetscReal angle)
{
  BodyArrays    *s = &b->state;
  const PetscInt g = s->body_group[k];

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  for (PetscInt a = 0; a < 3; a++) s->x[k][a] = x[a];
  for (PetscInt a = 0; a < 4; a++) s->q[k][a] = s->q_old[k][a] = q[a];
  s->angle[k] = angle;
  if (b->start[g]) BodySetStart(b, g, s->number[k] - s->group[g].first, s->x[k], s->q[k], angle);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSetBodyFitted(Bodies b, PetscInt group, const char surface[])
{
  BodyGroup *g = &b->state.group[group];

  PetscFunctionBeginUser;
  g->body_fitted = PETSC_TRUE;
  PetscCall(PetscStrncpy(g->surface, surface, sizeof(g->surface)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetEnergy(Bodies b, PetscReal *energy)
{
  const BodyArrays *s = &b->state;

  Exact sum = {{0}, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(&b->view, k);
    PetscReal        inertia[6], L[3], mass;

    if (s->removed[k] || !s->own[k]) continue;
    if (s->dim == 2) {
      const PetscReal square = PetscSqr(s->scale[k]);

      ExactAdd(&sum, 0.5 * s->density[k] * square *
                       (g->mass.volume * (PetscSqr(s->u[k][0]) + PetscSqr(s->u[k][1])) +
                        square * g->mass.inertia[2] * PetscSqr(s->w[k][2])));
      continue;
    }
    mass = s->density[k] * BodiesVolume(&b->view, k);
    PetscCall(BodiesGetInertia(b, k, NULL, PETSC_FALSE, inertia));
    apply_tensor(inertia, s->w[k], L);
    ExactAdd(&sum, 0.5 * (mass * dot3(s->u[k], s->u[k]) + dot3(s->w[k], L)));
  }
  PetscCall(ExactGetSum(BodiesComm(b), &sum, energy));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- state ---- */

/* The bodies of the file must be those of the scene: name, number, volume and inertia of every group */
static PetscErrorCode visit_groups(const BodyArrays *s, State state)
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
    PetscCheck(!strcmp(names, list), RunComm(), PETSC_ERR_USER_INPUT,
               "The checkpoint has the groups of bodies '%s', this scene '%s': restart with the same -particle_groups",
               names, list);
    PetscCall(PetscFree(names));
  }
  PetscCall(StateInts(state, "count", s->ngroups, count));
  PetscCall(StateReals(state, "measure", 2 * s->ngroups, flat));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const BodyGroup *group   = s->group + g;
    const PetscReal  mine[2] = {group->mass.volume, group->mass.inertia[2]};

    PetscCheck(count[g] == group->count, RunComm(), PETSC_ERR_USER_INPUT,
               "The checkpoint has %" PetscInt_FMT " bodies of group '%s', this scene %" PetscInt_FMT
               ": restart with the options of the run that wrote it",
               count[g], group->name, group->count);
    for (PetscInt i = 0; i < 2; i++)
      PetscCheck(PetscAbsReal(mine[i] - measure[g][i]) <= 1e-9 * PetscAbsReal(measure[g][i]), RunComm(),
                 PETSC_ERR_USER_INPUT,
                 "The bodies of group '%s' have another shape than in the checkpoint (%s %g, there %g): restart with the options -particle_%s_* of the run that "
                 "wrote it",
                 group->name, i ? "second moment" : "volume", (double)mine[i], (double)measure[g][i], group->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sizes come from the options, and must be those of the file, unless they change in time; files of before sizes have
   none */
static PetscErrorCode visit_sizes(Bodies b, const BodyRows *rows, State state)
{
  const BodyArrays *s = &b->state;
  PetscReal        *scale;
  PetscInt          n = s->nall;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) PetscCall(StateGetSize(state, "scale", &n));
  if (n != s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(s->n, &scale));
  PetscCall(PetscArraycpy(scale, s->scale, s->n));
  PetscCall(BodiesVisitReals(b, rows, state, "scale", 1, scale));
  PetscCall(BodiesResize(b, scale));
  for (PetscInt k = 0; k < s->n; k++)
    PetscCheck(PetscAbsReal(scale[k] - s->scale[k]) <= 1e-9 * scale[k], RunComm(), PETSC_ERR_USER_INPUT,
               "Body %" PetscInt_FMT
               " has %g times the size of its shape, in the checkpoint %g times: restart with the options -particle_%s_* of the run that wrote it",
               s->number[k], (double)s->scale[k], (double)scale[k], s->group[s->body_group[k]].name);
  PetscCall(PetscFree(scale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesVisitState(void *bodies, State state)
{
  Bodies      b = bodies;
  BodyArrays *s = &b->state;
  PetscInt   *removed;
  BodyRows    rows;

  PetscFunctionBeginUser;
  PetscCall(visit_groups(s, state));
  PetscCall(BodiesBeginRows(b, &rows));
  PetscCall(visit_sizes(b, &rows, state));
  PetscCall(StateReals(state, "dt_old", 1, &s->dt_old));
  for (PetscInt f = 0; f < NFIELDS; f++)
    PetscCall(BodiesVisitReals(b, &rows, state, FIELDS[f].name, FIELDS[f].width, *field(s, f)));
  PetscCall(StateReals(state, "time", 1, &s->time));
  PetscCall(BodyVisitStarts(b, &rows, state));
  PetscCall(BodiesVisitIntegers(b, &rows, state, "stopped", s->stopped));
  PetscCall(BodyVisitStops(b, &rows, state));
  PetscCall(PetscMalloc1(s->n, &removed));
  for (PetscInt k = 0; k < s->n; k++) removed[k] = s->removed[k];
  PetscCall(BodiesVisitIntegers(b, &rows, state, "gone", removed));
  for (PetscInt k = 0; k < s->n; k++) s->removed[k] = (PetscBool)removed[k];
  PetscCall(PetscFree(removed));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}
