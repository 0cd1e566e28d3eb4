/* Series: the tables series.csv and bodies.csv, a line a step, flushed, so that a running or killed job can be read.
   Columns stand in tables below, which are also the documentation of the files. The state of the bodies is the same
   on all ranks: rank 0 writes, and nothing is gathered. */
#include "compat.h"
#include "base/hdf5.h"
#include "base/rowtype.h"
#include "impl.h"
#include "bodies/local.h"
#include "files.h"
#include <errno.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

const MonitorColumn MONITOR_SERIES[] = {
  {"step", "", 12, "number of the step, 0 is the state before the first"},
  {"time", "time", 12, "at the end of the step"},
  {"dt", "time", 12, "length of the step, 0 in steady scenes"},
  {"cfl", "", 6, "largest CFL number of a cell"},
  {"outer_iterations", "", 12, "of the linear solves of the step"},
  {"divergence", "length^(dim/2)/time", 6,
   "L2 norm over the domain of its means over cells, less what elastic particles impose"},
  {"kinetic_energy", "energy", 12, "of the fluid; with nodal and penalty also of the fluid in bodies"},
  {"momentum_error", "", 6, "residual of the momentum balance, relative to the size of its forces"},
  {"seconds", "s", 6, "wall clock of the step"},
  {"seconds_nse", "s", 6, "of it, on rank 0, the flow equations"},
  {"seconds_force", "s", 6, "forces on bodies"},
  {"seconds_particle", "s", 6, "marking of nodes, motion and contact of bodies"},
  {"bodies_energy", "energy", 9, "kinetic energy of the bodies"},
  {"contact_energy", "energy", 9, "stored in contacts"},
  {"contact_work", "energy", 9, "of contact on the bodies since the beginning"},
  {NULL, NULL, 0, NULL},
};

#define TIME   1
#define NUMBER 2
#define GROUP  3 /* the one column of text */
const MonitorColumn MONITOR_BODIES[] = {
  {"step", "", 12, "number of the step"},
  {"time", "time", 12, "at the end of the step"},
  {"body", "", 12, "number of the body, from 0"},
  {"group", "", 0, "name of its group"},
  {"x", "length", 12, "centre of mass; with -sim_frame in the frame at rest, of the image in the box"},
  {"y", "length", 12, ""},
  {"z", "length", 12, "0 in 2D"},
  {"angle", "rad", 12, "not wrapped in 2D; in 3D of the rotation out of the initial position"},
  {"u", "length/time", 12, "velocity of the centre"},
  {"v", "length/time", 12, ""},
  {"w", "length/time", 12, ""},
  {"omega_x", "1/time", 12, "angular velocity"},
  {"omega_y", "1/time", 12, ""},
  {"omega_z", "1/time", 12, ""},
  {"force_x", "force", 12, "of the fluid"},
  {"force_y", "force", 12, ""},
  {"force_z", "force", 12, ""},
  {"torque_x", "force length", 12, "of the fluid, about the centre"},
  {"torque_y", "force length", 12, ""},
  {"torque_z", "force length", 12, ""},
  {"gap", "length", 12, "to the next body or wall, inf if nothing is near"},
  {"radius", "length", 12, "of a disc or sphere, else 0"},
  {"size", "", 12, "of the body, in that of its group's shape"},
  {"density", "density", 12, "of the body"},
  {"contact_force_x", "force", 12, "of contact with bodies and walls, mean over the step"},
  {"contact_force_y", "force", 12, ""},
  {"contact_force_z", "force", 12, ""},
  {"contact_torque_x", "force length", 12, "of contact, about the centre"},
  {"contact_torque_y", "force length", 12, ""},
  {"contact_torque_z", "force length", 12, ""},
  {"q0", "", 12, "in 3D: orientation, a unit quaternion that turns the body's axes into those of space, scalar first"},
  {"q1", "", 12, ""},
  {"q2", "", 12, ""},
  {"q3", "", 12, ""},
  {NULL, NULL, 0, NULL},
};

const MonitorColumn MONITOR_FURTHER[] = {
  {"cd", "", 12,
   "with -particle_<group>_reference_speed U: 2 F/(rho U^2 L), F the force of the fluid in x, L -particle_<group>_reference_length"},
  {"cl", "", 12, "the same of the force in y"},
  {"cd_residual", "", 12, "cd from the momentum residual"},
  {"cl_residual", "", 12, "cl from the momentum residual"},
  {"cd_volume", "", 12, "cd from the volume integral of the stress"},
  {"cl_volume", "", 12, "cl from the volume integral of the stress"},
  {"cd_<group>", "", 12, "with several such groups all of these end with the name of the group"},
  {"cl_<group>", "", 12, ""},
  {"cd_residual_<group>", "", 12, ""},
  {"cl_residual_<group>", "", 12, ""},
  {"cd_volume_<group>", "", 12, ""},
  {"cl_volume_<group>", "", 12, ""},
  {"dp", "pressure", 12, "with -monitor_dp: pressure at its first point less that at its second"},
  {"momentum_fluid_<x|y|z>", "force", 12, "with -monitor_momentum: rate of change of the momentum in the domain"},
  {"momentum_bodies_<x|y|z>", "force", 12, "the same: force of the bodies on the fluid"},
  {"momentum_walls_<x|y|z>", "force", 12, "the same: force of the walls"},
  {"momentum_inout_<x|y|z>", "force", 12, "the same: traction at inflows, less the momentum that flows out"},
  {"momentum_body_force_<x|y|z>", "force", 12, "the same: -flow_force over the domain"},
  {"momentum_others_<x|y|z>", "force", 12, "the same: forces of elastic solids, where there are any"},
  {"energy", "energy", 12,
   "with -monitor_energy: kinetic energy of fluid and bodies, the volume of bodies not counted twice"},
  {"energy_supplied", "energy", 12, "the same, since the end of the first step: by walls, openings, weight, loads"},
  {"energy_dissipated", "energy", 12, "dissipated by viscosity"},
  {"energy_boundary", "energy", 12,
   "dissipated by the boundary method: slip at bodies with penalty, compressible cells between two surfaces"},
  {"energy_scheme", "energy", 12, "dissipated by the time scheme, and carried out by the flow"},
  {"energy_events", "energy", 12,
   "with drops: of the surface of those that merged, broke up, vanished or left, in the steps of these events"},
  {"solid_x_<group>", "length", 12, "of an elastic group: centroid of its solid; of several the mean"},
  {"solid_y_<group>", "length", 12, ""},
  {"solid_z_<group>", "length", 12, "in space"},
  {"solid_u_<group>", "length/time", 12, "mean velocity"},
  {"solid_v_<group>", "length/time", 12, ""},
  {"solid_w_<group>", "length/time", 12, "in space"},
  {"solid_volume_error_<group>", "", 12,
   "its area (in space volume) over that at the start, less 1; of several the one furthest off"},
  {"solid_energy_<group>", "energy", 12, "strain energy of all"},
  {"solid_stretch_<group>", "", 12, "largest principal stretch"},
  {"solid_taylor_<group>", "", 12,
   "(a - b)/(a + b) of the ellipse with its second moments; in space of the longest and shortest axis; of several the mean"},
  {"solid_inclination_<group>", "rad", 12, "in the plane: the angle of a from x, likewise"},
  {"solid_axis_<x|y|z>_<group>", "", 12, "in space: direction of a, likewise"},
  {"solid_force_x_<group>", "force", 12, "force of the fluid on all, as that on rigid bodies without buoyancy"},
  {"solid_force_y_<group>", "force", 12, ""},
  {"solid_force_z_<group>", "force", 12, "in space"},
  {"solid_volume_kept_<group>", "", 12,
   "of an incompressible one that is not held, and of membranes: error of its volume in the step, put right at its end by moving its nodes away from the centroid (of a membrane along its normal); of several the one furthest off"},
  {"solid_area_error_<group>", "", 12,
   "of a membrane: its area (in the plane length) over that at the start, less 1; of several the mean"},
  {"solid_tension_<group>", "force/length (2D: force)", 12,
   "of a membrane with -particle_<group>_global_area_modulus: what that has it pull with; of several the mean"},
  {"watch_<x|y|z>_<group>_<i>", "length", 12, "displacement of point i of -particle_<group>_watch since the start"},
  {"aligned_penalty_bodies", "", 12,
   "method aligned: bodies that use the penalty, as the mesh could not be aligned with them in this step or one of the ten before; sum over the steps in summary.json, aligned_penalty_bodies_steps"},
  {"aligned_narrow_gaps", "", 12, "method aligned: bodies whose surface was moved back in narrow gaps"},
  {"aligned_extrapolated", "", 12,
   "method aligned: moved nodes whose old values were extrapolated by Taylor's formula"},
  {"aligned_unchanged", "", 12,
   "method aligned: moved nodes that found no old value at their new position and keep theirs"},
  {"aligned_cut_corners", "", 12,
   "method aligned: corners of bodies that the mesh cuts off; in 3D, vertices at edges of bodies that do not lie on them"},
  {"deform_area_min", "", 12, "with -mesh_deform and bodies that move: smallest size of a cell over the wanted one"},
  {"deform_area_max", "", 12, "the same: largest"},
  {"deform_jacobian", "", 12, "the same: smallest Jacobian in a cell over the cell's mean"},
  {"scalar_mean_<scalar>", "scalar", 12,
   "with -scalars: mean over what its content counts, weighted with the capacity"},
  {"scalar_min_<scalar>", "scalar", 12, "smallest value at a node (with a mean gradient: of what differs from it)"},
  {"scalar_max_<scalar>", "scalar", 12, "largest"},
  {"scalar_content_<scalar>", "scalar's energy", 14,
   "its heat: integral of capacity times value over the fluid and the bodies that keep heat (conjugate), not "
   "over those at a value, with a flux or in exchange"},
  {"scalar_error_<scalar>", "", 12,
   "rate of change, convection, sources and fluxes of boundaries and bodies summed, over the sum of their sizes"},
  {"scalar_source_<scalar>", "scalar's energy/time", 12,
   "of sources, less reactions; with it what the penalty and the surfaces of bodies let in"},
  {"scalar_bodies_<scalar>", "scalar's energy/time", 12,
   "through nodes that have the value of a body; all that bodies let in: scalar_from_<scalar>_<group>"},
  {"scalar_covered_<scalar>", "scalar's energy/time", 12,
   "heat that appears as bodies which move cover and free cells, less what is given back of the step before"},
  {"scalar_effective_<scalar>", "scalar's conductivity", 12,
   "with a mean gradient: effective conductivity of the box, in a flow with what that disperses along the gradient"},
  {"scalar_flux_<scalar>_<boundary>", "scalar's energy/time", 12,
   "into the domain through a boundary with a value or a flux"},
  {"scalar_from_<scalar>_<group>", "scalar's energy/time", 12,
   "what the bodies of a group that is held at a value, lumped, with a flux or in exchange let into the fluid, by any "
   "boundary method"},
  {"nusselt_<scalar>_<boundary>", "", 12,
   "with -scalar_<scalar>_reference_difference D: mean flux there times the reference length over conductivity times D"},
  {"mean_velocity_<x|y|z>", "length/time", 12, "mean over the domain, fluid and bodies"},
  {"frame_<x|y|z>", "length", 12, "with -sim_frame: displacement of the box since the start"},
  {"frame_velocity_<x|y|z>", "length/time", 12, "the same: velocity of the box in the step"},
  {"flow_force_<x|y|z>", "force/volume", 12,
   "with -flow_rate or -couple_backflow: the uniform force on fluid and bodies, -flow_force included"},
  {"driving_error", "", 12,
   "with -flow_force, -flow_rate or -couple_backflow: what bodies, walls and what accelerates lack of the uniform force on the whole domain, relative; negative: they take more. What convection moves across openings counts as taken, and so does what it takes in a closed domain, the error of too coarse cells, of which a remark tells"},
  {"backflow_error", "", 12,
   "with -couple_backflow flux: mean velocity along gravity over its root mean square; force: what accelerates all, over the weights"},
  {"bodies_velocity_<x|y|z>", "length/time", 12,
   "with -output_suspension: mean of the bodies that are free to move, by volume"},
  {"flow_rate_<boundary>", "length^3/time (2D: length^2/time)", 12,
   "out of the domain, or of the moving frame, through an inflow or outflow"},
  {"wall_force_<boundary>_<x|y|z>", "force", 12, "of the fluid on a wall, in 2D of unit depth"},
  {"probe_<number>_<u|v|w>", "length/time", 12, "with -monitor_probes: velocity there"},
  {"elastic_energy", "energy", 12, "viscoelastic fluids (-flow_rheology): free energy of the polymer, 0 at rest"},
  {"conformation_trace_max", "", 12, "the same: largest trace of the conformation, of three axes, 3 at rest"},
  {"conformation_eigenvalue_min", "", 12, "the same: its smallest eigenvalue, 1 at rest"},
  {"swimming_speed", "length/time", 12,
   "with -particle_<group>_slip_*: velocity of these bodies along their direction of swimming, mean of all of them"},
  {"slip_power", "power", 12,
   "the same: what their surfaces do to the fluid around them beyond force and torque, sum of all"},
  {"bonds", "", 12, "with -contact_bond_law: bonds that hold (bonds.csv: when they formed and broke)"},
  {"bonds_broken", "", 12, "those that have broken"},
  {"bond_energy", "energy", 12, "stored in bonds, part of contact_energy"},
  {"drops", "", 12, "where particles are a fluid: how many drops there are (drops.csv: a line a step and drop)"},
  {"drops_merged", "", 12, "how often two have become one so far"},
  {"drops_broken", "", 12, "how often one has become two"},
  {"drop_volume_error", "", 12, "largest error of a drop's volume, relative"},
  {"drop_volume_lost", "length^3 (2D: length^2)", 12, "volume of drops that vanished so far"},
  {"drops_left", "", 12, "in the plane: drops that have left through openings so far"},
  {"drop_volume_left", "length^3 (2D: length^2)", 12, "their volume"},
  {"drop_volume_shift", "cells", 12, "largest way of an interface along its normals that kept a volume in the step"},
  {"spring_energy", "energy", 12,
   "with -particle_<group>_spring or _mooring_stiffness: stored in springs and moorings"},
  {"cells", "", 12, "with -mesh_adapt: of the mesh of this round"},
  {"unknowns", "", 12, "with -mesh_adapt: of the mesh of this round"},
  {"error_indicator", "", 12, "with -mesh_adapt: estimated error of the velocity gradients, relative to them"},
  {"step_error", "", 12, "with -sim_adapt: estimated error of the step over the tolerance"},
  {"rejected_steps", "", 12, "with -sim_adapt: steps taken back so far"},
  {"step_limit", "", 12,
   "with -sim_adapt: who gave the step its length, its place in step_limits of summary.json, from 0"},
  {NULL, NULL, 0, NULL},
};

#define NSERIES (PETSC_STATIC_ARRAY_LENGTH(MONITOR_SERIES) - 1)
#define NPLANE  (NBODIES - 4) /* without q0 .. q3 */
#define NBODIES (PETSC_STATIC_ARRAY_LENGTH(MONITOR_BODIES) - 1)

#define HEADING (1024 + MAX_COLUMNS * 65) /* characters of a heading */

/* ---- names ---- */

/* Does the name fit the pattern, in which <...> stands for any text? */
static PetscBool fits(const char *pattern, const char *name)
{
  for (; *pattern && *pattern != '<'; pattern++, name++)
    if (*pattern != *name) return PETSC_FALSE;
  if (!*pattern) return (PetscBool) !*name;
  pattern = strchr(pattern, '>') + 1;
  for (name += *name != 0; *name; name++)
    if (fits(pattern, name)) return PETSC_TRUE;
  return fits(pattern, name);
}

PetscBool MonitorExplains(const char name[])
{
  for (const MonitorColumn *c = MONITOR_FURTHER; c->name; c++)
    if (fits(c->name, name)) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* ---- files ---- */

PetscErrorCode SeriesOpenFile(Monitor m, const char name[], const char heading[], PetscBool append, FILE **file)
{
  char path[PETSC_MAX_PATH_LEN];
  int  err = 0;

  PetscFunctionBeginUser;
  *file = NULL;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", m->dir, name));
  if (m->rank == 0) {
    *file = fopen(path, append ? "a" : "w");
    if (!*file || fputs(heading, *file) < 0 || fflush(*file)) err = errno ? errno : EIO;
  }
  PetscCall(FileCheck(m->comm, err, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rank 0: open a file of the run, cut it at `length` bytes and go on there. 0, errno (ENOENT: no such file, or one of a
   restart that had nothing left to do, which is no line), or -1 with the reason why it is not a file of this run. */
static int cut_file(const char path[], const char heading[], PetscReal length, FILE **file, const char **reason)
{
  char first[HEADING] = "";

  *file = fopen(path, "r+");
  if (!*file) return errno;
  if (!fgets(first, sizeof(first), *file) || strcmp(first, heading)) *reason = "its columns are others";
  else if (fseek(*file, 0, SEEK_END)) return errno;
  else if (ftell(*file) == (long)strlen(heading)) return FileClose(file) ? errno : ENOENT;
  else if ((PetscReal)ftell(*file) < length) *reason = "it is shorter than when the checkpoint was written";
  else if (ftruncate(fileno(*file), (off_t)length) || fseek(*file, 0, SEEK_END)) return errno;
  return *reason ? -1 : 0;
}

/* A new table, or after a restart the one that is there */
static PetscErrorCode open_table(Monitor m, const char name[], const char heading[], PetscReal length, FILE **file)
{
  char        path[PETSC_MAX_PATH_LEN], why[128] = "";
  const char *reason = NULL;
  int         err    = 0;

  PetscFunctionBeginUser;
  *file = NULL;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", m->dir, name));
  if (!m->before.restarted) err = ENOENT;
  else if (m->rank == 0) err = cut_file(path, heading, length, file, &reason);
  if (reason) PetscCall(PetscStrncpy(why, reason, sizeof(why)));
  PetscCallMPI(MPI_Bcast(&err, 1, MPI_INT, 0, m->comm));
  PetscCallMPI(MPI_Bcast(why, sizeof(why), MPI_CHAR, 0, m->comm));
  PetscCheck(err >= 0, m->comm, PETSC_ERR_USER_INPUT,
             "'%s' does not belong to the run that is restarted: %s. Choose another -output_dir; it begins with the first step after the checkpoint",
             path, why);
  if (err == ENOENT) PetscCall(SeriesOpenFile(m, name, heading, PETSC_FALSE, file));
  else PetscCall(FileCheck(m->comm, err, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Columns of bodies.csv in this run */
static size_t count_body_columns(Monitor m)
{
  return m->bodies->dim == 3 ? NBODIES : NPLANE;
}

static PetscErrorCode write_heading(const MonitorColumn column[], size_t n, char heading[], size_t len)
{
  PetscFunctionBeginUser;
  heading[0] = 0;
  for (size_t i = 0; i < n; i++) {
    if (i) PetscCall(PetscStrlcat(heading, ",", len));
    PetscCall(PetscStrlcat(heading, column[i].name, len));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SeriesOpen(Monitor m)
{
  char heading[HEADING];

  PetscFunctionBeginUser;
  PetscCall(write_heading(MONITOR_SERIES, NSERIES, heading, sizeof(heading)));
  for (PetscInt i = 0; i < m->ncolumn; i++) {
    PetscCall(PetscStrlcat(heading, ",", sizeof(heading)));
    PetscCall(PetscStrlcat(heading, m->column[i].name, sizeof(heading)));
  }
  PetscCall(PetscStrlcat(heading, "\n", sizeof(heading)));
  PetscCall(open_table(m, "series.csv", heading, m->before.length[0], &m->series));
  PetscCall(write_heading(MONITOR_BODIES, count_body_columns(m), heading, sizeof(heading)));
  PetscCall(PetscStrlcat(heading, "\n", sizeof(heading)));
  PetscCall(open_table(m, "bodies.csv", heading, m->before.length[1], &m->body_file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_tables(Monitor m, int series, int bodies)
{
  char path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/%s", m->dir, series ? "series.csv" : "bodies.csv"));
  PetscCall(FileCheck(m->comm, series ? series : bodies, path));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SeriesClose(Monitor m)
{
  const int series = FileClose(&m->series), bodies = FileClose(&m->body_file);

  PetscFunctionBeginUser;
  PetscCall(check_tables(m, series, bodies));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- lines ---- */

static PetscReal body_angle(const BodyState *b, PetscInt k)
{
  const PetscReal *q = b->q[k];

  return b->dim == 2 ? b->angle[k] : 2 * PetscAtan2Real(PetscSqrtReal(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), q[0]);
}

/* group, last of line: its number */
static void fill_line(const MonitorStep *s, const BodyState *b, PetscInt k, PetscReal line[NBODIES])
{
  const PetscReal *x = b->x[k], *u = b->u[k], *w = b->w[k], *F = b->force[k], *T = b->torque[k], *q = b->q[k];
  const PetscReal *C = b->contact_force[k], *D = b->contact_torque[k];
  const PetscReal  at[3]          = {x[0] + b->frame[0], x[1] + b->frame[1], x[2] + b->frame[2]};
  const PetscReal  gap            = b->gap[k] < PETSC_MAX_REAL ? b->gap[k] : (PetscReal)INFINITY;
  const PetscReal  value[NBODIES] = {s->step,      s->time,
                                     b->number[k], b->body_group[k],
                                     at[0],        at[1],
                                     at[2],        body_angle(b, k),
                                     u[0],         u[1],
                                     u[2],         w[0],
                                     w[1],         w[2],
                                     F[0],         F[1],
                                     F[2],         T[0],
                                     T[1],         T[2],
                                     gap,          BodiesGetDisc(b, k),
                                     b->scale[k],  b->density[k],
                                     C[0],         C[1],
                                     C[2],         D[0],
                                     D[1],         D[2],
                                     q[0],         q[1],
                                     q[2],         q[3]};

  memcpy(line, value, sizeof(value));
}

static void print_line(Monitor m, const PetscReal line[NBODIES])
{
  for (size_t i = 0; i < count_body_columns(m); i++) {
    if (i == GROUP) fprintf(m->body_file, ",%s", m->bodies->group[(PetscInt)line[i]].name);
    else fprintf(m->body_file, "%s%.*g", i ? "," : "", (int)MONITOR_BODIES[i].digits, (double)line[i]);
  }
  fprintf(m->body_file, "\n");
}

/* The lines of bodies that are asked for come from their owners to rank 0, which prints them by number. Collective. */
static PetscErrorCode print_spread(Monitor m, const MonitorStep *s)
{
  const BodyState *b = m->bodies;
  PetscReal(*mine)[NBODIES], (*line)[NBODIES] = NULL;
  PetscMPIInt  n = 0, *count = NULL, *start = NULL;
  PetscInt     total = 0, *number = NULL, *order = NULL;
  MPI_Datatype type;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(PetscMin(b->n, m->last_body - m->first_body + 1), &mine));
  for (PetscInt k = 0; k < b->n; k++)
    if (b->own[k] && b->number[k] >= m->first_body && b->number[k] <= m->last_body) fill_line(s, b, k, mine[n++]);
  if (m->rank == 0) PetscCall(PetscMalloc2(m->size, &count, m->size, &start));
  PetscCallMPI(MPI_Gather(&n, 1, MPI_INT, count, 1, MPI_INT, 0, m->comm));
  for (PetscMPIInt r = 0; r < m->size && m->rank == 0; total += count[r++])
    PetscCall(PetscMPIIntCast(total, start + r));
  PetscCall(PetscMalloc3(total, &line, total, &number, total, &order));
  PetscCall(RowTypeCreate(NBODIES, &type));
  PetscCallMPI(MPI_Gatherv(mine, n, type, line, count, start, type, 0, m->comm));
  PetscCall(RowTypeDestroy(&type));
  for (PetscInt i = 0; i < total; i++) {
    number[i] = (PetscInt)line[i][NUMBER];
    order[i]  = i;
  }
  PetscCall(PetscSortIntWithArray(total, number, order));
  for (PetscInt i = 0; i < total; i++) print_line(m, line[order[i]]);
  PetscCall(PetscFree(mine));
  PetscCall(PetscFree2(count, start));
  PetscCall(PetscFree3(line, number, order));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Column i of n lines of this rank. Collective. */
static PetscErrorCode write_column(Hdf5 file, size_t i, PetscInt n, const PetscReal (*line)[NBODIES])
{
  PetscReal *value;
  PetscInt  *number;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n, &value, n, &number));
  for (PetscInt r = 0; r < n; r++) {
    value[r]  = line[r][i];
    number[r] = (PetscInt)(i == NUMBER || i == GROUP ? value[r] : 0);
  }
  if (i == NUMBER || i == GROUP) PetscCall(Hdf5WriteInts(file, MONITOR_BODIES[i].name, n, 1, number));
  else PetscCall(Hdf5WriteReals(file, MONITOR_BODIES[i].name, n, 1, value));
  PetscCall(PetscFree2(value, number));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As an attribute of the file, with commas between them. Collective. */
static PetscErrorCode write_group_names(Monitor m, Hdf5 file)
{
  const size_t capacity = 1 + (size_t)m->bodies->ngroups * sizeof(m->bodies->group->name);
  size_t       length;
  char        *names;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(capacity, &names));
  for (PetscInt g = 0; g < m->bodies->ngroups; g++) {
    if (g) PetscCall(PetscStrlcat(names, ",", capacity));
    PetscCall(PetscStrlcat(names, m->bodies->group[g].name, capacity));
  }
  PetscCall(PetscStrlen(names, &length));
  PetscCall(Hdf5WriteAttribute(file, "/", "groups", HDF5_BYTE, (PetscInt)length + 1, names));
  PetscCall(PetscFree(names));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The lines of a step as table_<step>.h5, a dataset a column, written by all ranks that have rows. Collective. */
static PetscErrorCode write_table(Monitor m, const MonitorStep *s)
{
  const BodyState *b = m->bodies;
  BodyRows         rows;
  Hdf5             file;
  PetscReal(*mine)[NBODIES], (*line)[NBODIES];
  PetscInt first, last;
  char     path[PETSC_MAX_PATH_LEN];

  PetscFunctionBeginUser;
  PetscCall(BodiesBeginRows(m->all, &rows));
  PetscCall(PetscMalloc2(b->n, &mine, rows.n, &line));
  for (PetscInt k = 0; k < b->n; k++) fill_line(s, b, k, mine[k]);
  PetscCall(BodiesGatherRows(m->all, &rows, sizeof(*mine), mine, line));
  first = PetscMin(PetscMax(m->first_body - rows.start, 0), rows.n);
  last  = PetscMax(PetscMin(m->last_body + 1 - rows.start, rows.n), first);
  PetscCall(PetscSNPrintf(path, sizeof(path), "%s/table_%" PetscInt_FMT ".h5", m->dir, s->step));
  PetscCall(Hdf5Create(m->comm, path, &file));
  PetscCall(Hdf5WriteReals(file, MONITOR_BODIES[TIME].name, m->rank ? 0 : 1, 1, &s->time));
  PetscCall(write_group_names(m, file));
  for (size_t i = NUMBER; i < count_body_columns(m); i++)
    PetscCall(write_column(file, i, last - first, (const PetscReal(*)[NBODIES])(line + first)));
  PetscCall(PetscFree2(mine, line));
  PetscCall(BodiesEndRows(&rows));
  PetscCall(FileCloseHdf5(m->comm, path, &file));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode print_bodies(Monitor m, const MonitorStep *s)
{
  PetscReal line[NBODIES];

  PetscFunctionBeginUser;
  if (m->last_body < m->first_body) PetscFunctionReturn(PETSC_SUCCESS);
  if (m->tables) PetscCall(write_table(m, s));
  else if (BodiesComm(m->all) != PETSC_COMM_SELF) PetscCall(print_spread(m, s));
  else if (m->rank == 0)
    for (PetscInt k = m->first_body; k <= m->last_body; k++) {
      fill_line(s, m->bodies, k, line);
      print_line(m, line);
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* seconds: of the phases in this step */
static void print_series(Monitor m, const MonitorStep *s, const PetscReal seconds[])
{
  const PetscReal value[NSERIES] = {s->step,
                                    s->time,
                                    s->dt,
                                    s->cfl,
                                    s->outer_iterations,
                                    s->divergence,
                                    s->kinetic_energy,
                                    s->momentum_error,
                                    s->seconds,
                                    seconds[MONITOR_NSE],
                                    seconds[MONITOR_FORCE],
                                    seconds[MONITOR_PARTICLE],
                                    s->bodies_energy,
                                    s->contact_energy,
                                    s->contact_work};

  for (size_t i = 0; i < NSERIES; i++)
    fprintf(m->series, "%s%.*g", i ? "," : "", (int)MONITOR_SERIES[i].digits, (double)value[i]);
  for (PetscInt i = 0; i < m->ncolumn; i++) fprintf(m->series, ",%.12g", (double)m->column[i].value);
  fprintf(m->series, "\n");
}

PetscErrorCode SeriesAppend(Monitor m, const MonitorStep *s, const PetscReal seconds[])
{
  int err[2] = {0, 0};

  PetscFunctionBeginUser;
  PetscCall(print_bodies(m, s));
  if (m->rank == 0) {
    print_series(m, s, seconds);
    if (fflush(m->series) || ferror(m->series)) err[0] = errno ? errno : EIO;
    if (fflush(m->body_file) || ferror(m->body_file)) err[1] = errno ? errno : EIO;
  }
  PetscCall(check_tables(m, err[0], err[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
