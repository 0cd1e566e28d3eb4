/* Tables: what is in the files of a run, in print (runs/reference/OUTPUT.md, -help output). */
#include "compat.h"
#include "report/eventtable.h"
#include "report/monitor.h"
#include "report/statistics.h"
#include "report/suspension.h"
#include <string.h>

/* Datasets; "shape" takes the place of digits */
typedef struct {
  const char *name, *unit, *shape, *meaning;
} Dataset;

static const Dataset FIELDS[] = {
  {"time", "time", "[1]", ""},
  {"velocity", "length/time", "[points][3]", "at the nodes of the elements, second order"},
  {"vorticity", "1/time", "[points] (3D: [points][3])", "average of the cells around a node"},
  {"pressure", "pressure", "[points]",
   "average of the cells around a node, for pictures; those inside bodies do not count"},
  {"body", "", "[points]",
   "number of the body that the point lies in, by the sign of the distance, or -1; in runs with bodies"},
  {"pressure_mean", "pressure", "[cells]",
   "with the next one the pressure of the method, linear in each cell: value at the cell's middle node"},
  {"pressure_gradient", "pressure/length", "[cells][3]", "in the cell"},
  {"phase", "", "[cells]", "with drops: 0 in the fluid around, 1 and up in drops, by their groups"},
  {NULL, NULL, NULL, NULL},
};
static const Dataset MESH[] = {
  {"coordinates", "length", "[points][3]",
   "nodes; on a periodic mesh some once more across the period, so that cells are whole"},
  {"cells", "", "[cells][9] (3D: [27])", "points of a cell in the order of VTK"},
  {NULL, NULL, NULL, NULL},
};
static const Dataset SOLIDS[] = {
  {"time", "time", "[1]", ""},
  {"coordinates", "length", "[nodes][3]", "of the solids' meshes as they are"},
  {"displacement", "length", "[nodes][3]", "since the start"},
  {"velocity", "length/time", "[nodes][3]", ""},
  {"cells", "", "[cells][9]", "nodes of a cell in VTK's order"},
  {"solid", "", "[cells]", "number of the solid"},
  {"J", "", "[cells]", "volume over that at the start"},
  {"stress", "pressure", "[cells][6]",
   "Cauchy stress of the law xx yy zz xy xz yz; of an incompressible solid without the flow's pressure"},
  {NULL, NULL, NULL, NULL},
};

static const Dataset DROPS[] = {
  {"time", "time", "[1]", ""},
  {"coordinates", "length", "[3 edges][3]",
   "of the interface at the end of the step, in space [9 faces][3]; in one piece across a period"},
  {"edge", "", "[edges][3]", "first, last and middle point of a quadratic edge; edges of a curve follow each other"},
  {"face", "", "[faces][9]",
   "in space, in place of edges: corners, middles of sides and middle of a biquadratic face, counter-clockwise as seen "
   "from outside"},
  {"drop", "", "[edges]", "number of the drop, as in drops.csv"},
  {"group", "", "[edges]", "number of its group among those that are fluids, from 0"},
  {"curve", "", "[edges]", "number of the closed curve or surface"},
  {NULL, NULL, NULL, NULL},
};

static const Dataset BODIES[] = {
  {"time", "time", "[1]", ""},
  {"position", "length", "[bodies][3]", "centre of mass"},
  {"velocity", "length/time", "[bodies][3]", ""},
  {"angular_velocity", "1/time", "[bodies][3]", ""},
  {"force", "force", "[bodies][3]", "of the fluid"},
  {"contact_force", "force", "[bodies][3]", "of other bodies and walls"},
  {"orientation", "", "[bodies][4]", "unit quaternion that turns the body's axes into those of space, scalar first"},
  {"angle", "rad", "[bodies]", "not wrapped; in 3D the integral of the angular velocity about z"},
  {"radius", "length", "[bodies]", "of the bounding circle or sphere, 0: has left the domain"},
  {"group, body", "", "[bodies]", "numbers of the group and of the body, from 0"},
  {"outline", "length", "[lines * points][3]",
   "2D: of every body and then of its images across a period; begins on the body's first axis"},
  {"line", "", "[lines][points + 1]", "2D: points of a closed line"},
  {"surface", "length", "[points][3]", "3D: points of the triangles, bodies and images"},
  {"triangle", "", "[triangles][3]", "3D: their points, normals outward"},
  {"cell_body, cell_group", "", "[lines or triangles]", "body and group that a line or triangle belongs to"},
  {"cell_velocity, cell_angular_velocity", "length/time, 1/time", "[lines or triangles][3]", "of that body"},
  {"aggregate, cell_aggregate", "", "[bodies], [lines or triangles]",
   "with -contact_bond_law: number of the lowest body that bonds join to this one, -1: alone"},
  {NULL, NULL, NULL, NULL},
};
static const Dataset BONDS[] = {
  {"time", "time", "[1]", ""},
  {"end", "length", "[2 bonds][3]",
   "of each bond the centre of its body and that of its partner, or the end on a wall; in one piece across a period"},
  {"line", "", "[bonds][2]", "its two ends"},
  {"body, partner", "", "[bonds]", "numbers; a wall is below 0"},
  {"tension", "force", "[bonds]", "pull along the bond in the last step; negative: pressure"},
  {"shear", "force", "[bonds]", ""},
  {"twist, bending", "force length", "[bonds]", "moments"},
  {"energy", "energy", "[bonds]", "stored in it"},
  {"formed", "time", "[bonds]", "when"},
  {"aggregate", "", "[bonds]", "number of the lowest body of its aggregate"},
  {NULL, NULL, NULL, NULL},
};

/* Text in a cell of a table: '|' would end it, <group> is no HTML, '_' and '*' would be emphasis */
static void print_cell(FILE *file, const char text[])
{
  fprintf(file, "|%s", text[0] ? " " : "");
  for (; *text; text++) fprintf(file, strchr("|<*_", *text) ? "\\%c" : "%c", *text);
  fprintf(file, " ");
}

static void print_columns(FILE *file, const char title[], const MonitorColumn *c)
{
  fprintf(file, "\n## %s\n\n| column | unit | meaning |\n| --- | --- | --- |\n", title);
  for (; c->name; c++) {
    fprintf(file, "| `");
    for (const char *p = c->name; *p; p++) fprintf(file, *p == '|' ? "\\|" : "%c", *p);
    fprintf(file, "` ");
    print_cell(file, c->unit);
    print_cell(file, c->meaning);
    fprintf(file, "|\n");
  }
}

static void print_datasets(FILE *file, const char title[], const Dataset *d)
{
  fprintf(file, "\n## %s\n\n| dataset | unit | shape | meaning |\n| --- | --- | --- | --- |\n", title);
  for (; d->name; d++) {
    fprintf(file, "| `%s` ", d->name);
    print_cell(file, d->unit);
    print_cell(file, d->shape);
    print_cell(file, d->meaning);
    fprintf(file, "|\n");
  }
}

void MonitorPrintTables(FILE *file)
{
  fprintf(file,
          "# Output\n\nMade by `make options` from the tables in `src/report`; `build/tumble -help output` prints the same. Units are those "
          "of the scene:\nlength, time and mass, from which force, energy and pressure follow; in 2D they are those of unit depth. An empty meaning "
          "is that of the row above.\n");
  print_columns(file, "series.csv: a line a step", MONITOR_SERIES);
  print_columns(file, "series.csv: further columns, where a scene has what they tell", MONITOR_FURTHER);
  print_columns(file,
                "bodies.csv: a line a step and body; or table_<step>.h5: a dataset [bodies] each but step and time [1] (-output_bodies_format)",
                MONITOR_BODIES);
  print_columns(file, "drops.csv in the plane, where particles are fluid: a line a step and drop", EVENT_DROPS);
  print_columns(file, "drops.csv in space", EVENT_DROPS_SPACE);
  print_columns(file, "bonds.csv, with -contact_bond_law: a line a bond that forms or breaks", EVENT_BONDS);
  print_columns(file, "aggregates.csv, likewise: a line a step in which one does", EVENT_AGGREGATES);
  print_columns(file, "pairs_<step>.csv, with -output_suspension at snapshots and after the last step",
                SUSPENSION_PAIRS);
  print_columns(file, "profile_<step>.csv, likewise: a line a slab", SUSPENSION_PROFILE);
  print_columns(file, "contacts_<step>.csv, likewise: a line a contact", SUSPENSION_CONTACTS);
  print_columns(file,
                "statistics.csv, with -output_statistics at snapshots and after the last step: a line a plane of nodes",
                STATISTICS);
  print_datasets(file, "mesh.h5, mesh_<step>.h5", MESH);
  print_datasets(file, "fields_<step>.h5, described by fields.xdmf, the newest by fields_last.xdmf alone", FIELDS);
  fprintf(file,
          "\nParaView: open fields.xdmf and bodies.xdmf (of several readers the one called XDMF Reader). Cells are quadratic: the display property "
          "Nonlinear\nSubdivision Level at 2 or 3, or the filter Tessellate, shows curved sides and parabolas, which 1 draws straight. Python: "
          "pyvista.read,\nmeshio.xdmf.TimeSeriesReader, meshio.read of fields_last.xdmf, or tumble.open(...).snapshot().pyvista().\n");
  print_datasets(file, "solid_<step>.h5, described by solid_<step>.xdmf, where particles are elastic", SOLIDS);
  print_datasets(file, "drops_<step>.h5, described by drops_<step>.xdmf, where particles are fluid", DROPS);
  print_datasets(file, "bodies_<step>.h5, described by bodies.xdmf (what is drawn) and centres.xdmf", BODIES);
  print_datasets(file, "bonds_<step>.h5, described by bonds.xdmf, with -contact_bond_law", BONDS);
}
