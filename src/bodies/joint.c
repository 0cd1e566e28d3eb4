/* Joint: see joint.h. */
#include "compat.h"
#include "joint.h"
#include "base/algebra.h"
#include "base/opt.h"

static PetscErrorCode read_spring(const char group[], PetscInt dim, Motion *m)
{
  char      spring[OPT_NAME], damping[OPT_NAME], angle[OPT_NAME];
  PetscBool turned, damped;

  PetscFunctionBeginUser;
  PetscCall(OptHas(OptJoin("-particle_", group, "_spring", spring), &turned));
  PetscCall(OptReal(spring, &m->spring));
  PetscCall(OptHas(OptJoin("-particle_", group, "_spring_damping", damping), &damped));
  PetscCall(OptReal(damping, &m->spring_damping));
  if (turned) PetscCall(OptReal(OptJoin("-particle_", group, "_spring_angle", angle), &m->spring_angle));
  PetscCheck((!turned && !damped) || dim == 2 || m->has_hinge, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: in space a spring needs the axis of the angle: give -particle_%s_hinge", turned ? spring : damping,
             group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One value for all moorings or one each, into the same field of all of them */
static PetscErrorCode read_each(const char name[], Motion *m, PetscReal *first)
{
  const PetscInt n = m->nmooring;
  PetscReal     *value;
  PetscInt       given;

  PetscFunctionBeginUser;
  PetscCall(OptCountItems(name, &given));
  PetscCall(PetscCalloc1(PetscMax(n, given), &value));
  PetscCheck(given <= 1 || given == n, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s has %" PetscInt_FMT " values for %" PetscInt_FMT " mooring%s: give one for all, or one each", name,
             given, n, n == 1 ? "" : "s");
  PetscCall(OptRealArray(name, PetscMax(1, given), value, NULL));
  for (PetscInt i = 0; i < n; i++)
    *(PetscReal *)((char *)first + (size_t)i * sizeof(Mooring)) = value[given > 1 ? i : 0];
  PetscCall(PetscFree(value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points of all moorings: list [n][dim], or one for all; field: [3] of the first */
static PetscErrorCode read_points(const char name[], PetscInt dim, Motion *m, PetscReal *field, PetscBool *found)
{
  const PetscInt n = m->nmooring;
  PetscReal     *value;
  PetscInt       given;

  PetscFunctionBeginUser;
  PetscCall(OptCountItems(name, &given));
  *found = (PetscBool)(given > 0);
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(given == dim || given == n * dim, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s has %" PetscInt_FMT " values for %" PetscInt_FMT " mooring%s in %" PetscInt_FMT
             " dimensions: give %" PetscInt_FMT " a point",
             name, given, n, n == 1 ? "" : "s", dim, dim);
  PetscCall(PetscMalloc1(given, &value));
  PetscCall(OptRealArray(name, given, value, NULL));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0; a < dim; a++)
      ((PetscReal *)((char *)field + (size_t)i * sizeof(Mooring)))[a] = value[(given == dim ? 0 : i * dim) + a];
  PetscCall(PetscFree(value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_moorings(const char group[], PetscInt dim, Motion *m)
{
  char      name[OPT_NAME], stiffness[OPT_NAME], damping[OPT_NAME];
  PetscInt  given;
  PetscBool wanted, damped, has_at, found;

  PetscFunctionBeginUser;
  PetscCall(OptHas(OptJoin("-particle_", group, "_mooring_damping", damping), &damped));
  PetscCall(OptHas(OptJoin("-particle_", group, "_mooring_stiffness", stiffness), &wanted));
  PetscCall(OptCountItems(OptJoin("-particle_", group, "_mooring", name), &given));
  PetscCheck(wanted || damped || !given, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s needs %s or %s", name, stiffness,
             damping);
  if (!wanted && !damped) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(given % dim == 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s has %" PetscInt_FMT " values: give %" PetscInt_FMT " for each point, one point after the other", name,
             given, dim);
  m->nmooring   = PetscMax(1, given / dim);
  m->from_start = (PetscBool)!given;
  PetscCall(PetscCalloc1(m->nmooring, &m->mooring));
  PetscCall(read_points(name, dim, m, m->mooring->point, &found));
  PetscCall(read_points(OptJoin("-particle_", group, "_mooring_at", name), dim, m, m->mooring->at, &has_at));
  for (PetscInt i = 0; i < m->nmooring && !has_at; i++) m->mooring[i].at[0] = PETSC_MAX_REAL; /* the centre */
  PetscCall(read_each(stiffness, m, &m->mooring->stiffness));
  PetscCall(read_each(damping, m, &m->mooring->damping));
  PetscCall(read_each(OptJoin("-particle_", group, "_mooring_length", name), m, &m->mooring->length));
  PetscCall(OptBool(OptJoin("-particle_", group, "_mooring_slack", name), &m->slack));
  for (PetscInt i = 0; i < m->nmooring; i++)
    PetscCheck(!m->slack || m->mooring[i].length > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s: a line that can be slack has a length: give -particle_%s_mooring_length", name, group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode JointRead(const char group[], PetscInt dim, Motion *m)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(ExprRead(OptJoin("-particle_", group, "_force", name), dim, dim, m->force, &m->force_of, NULL));
  PetscCall(ExprRead(OptJoin("-particle_", group, "_torque", name), dim, dim == 2 ? 1 : 3,
                     dim == 2 ? m->torque + 2 : m->torque, &m->torque_of, NULL));
  PetscCall(read_spring(group, dim, m));
  PetscCall(read_moorings(group, dim, m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode JointDestroy(Motion *m)
{
  PetscFunctionBeginUser;
  PetscCall(ExprDestroy(&m->force_of));
  PetscCall(ExprDestroy(&m->torque_of));
  PetscCall(PetscFree(m->mooring));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void JointSetCentre(Motion *m, const PetscReal centroid[3])
{
  for (PetscInt i = 0; i < m->nmooring; i++) {
    const PetscBool central = (PetscBool)(m->mooring[i].at[0] == PETSC_MAX_REAL);

    for (PetscInt a = 0; a < 3; a++)
      m->mooring[i].at[a] = central ? 0 : m->mooring[i].at[a] - (a < m->dim ? centroid[a] : 0);
  }
}

PetscErrorCode JointCheck(const char group[], const Motion *m, PetscInt free)
{
  PetscFunctionBeginUser;
  PetscCheck((m->spring == 0 && m->spring_damping == 0) || (free & BODY_FREE_ROTATION), PETSC_COMM_SELF,
             PETSC_ERR_USER_INPUT,
             "-particle_%s_spring needs a body that turns freely: give -particle_%s_free rotation, or remove it", group,
             group);
  PetscCheck(!m->nmooring || free, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_mooring_stiffness needs a body that moves freely: nothing of group '%s' is free (-particle_%s_free)",
             group, group, group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool JointActs(const Motion *m)
{
  return (PetscBool)(m->force_of || m->torque_of || m->spring > 0 || m->spring_damping > 0 || m->nmooring ||
                     dot3(m->force, m->force) > 0 || dot3(m->torque, m->torque) > 0);
}

PetscErrorCode JointView(const Motion *m, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (m->force_of) PetscCall(PetscViewerASCIIPrintf(viewer, "  force %s\n", ExprText(m->force_of)));
  if (m->torque_of) PetscCall(PetscViewerASCIIPrintf(viewer, "  torque %s\n", ExprText(m->torque_of)));
  if (m->spring > 0 || m->spring_damping > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  spring of stiffness %g, damping %g, at rest at the angle %g\n",
                                     (double)m->spring, (double)m->spring_damping, (double)m->spring_angle));
  for (PetscInt i = 0; i < m->nmooring; i++) {
    const Mooring *l = &m->mooring[i];

    if (m->from_start) PetscCall(PetscViewerASCIIPrintf(viewer, "  moored to where it starts"));
    else
      PetscCall(PetscViewerASCIIPrintf(viewer, "  moored to (%g, %g, %g)", (double)l->point[0], (double)l->point[1],
                                       (double)l->point[2]));
    PetscCall(PetscViewerASCIIPrintf(viewer, ", stiffness %g, damping %g, length %g%s\n", (double)l->stiffness,
                                     (double)l->damping, (double)l->length, m->slack ? ", may be slack" : ""));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
