/* Writes a mesh as a Gmsh file: every format, order and orientation, from any number of ranks. For tests of the
   reader. */
#pragma once
#include "core.h"

/* How a mesh is written */
typedef struct {
  double    version;
  PetscBool binary;
  PetscInt  order;    /* 1, 2; -2: without the middles of faces and cells */
  PetscInt  turned;   /* every so many cells are turned, 0: none */
  PetscInt  nameless; /* boundary without edges in the file, -1: all have them */
  PetscInt  groups;   /* 2: with names, 1: numbers alone, 0: no groups */
  PetscInt  stretch;  /* numbers of nodes go up by this */
} Form;

static const Form PLAIN = {.version = 4.1, .order = 2, .nameless = -1, .groups = 2, .stretch = 1};

/* Lattice places in Gmsh's order */
static const PetscInt QUAD[9] = {0, 2, 8, 6, 1, 5, 7, 3, 4};
static const PetscInt HEX[27] = {0,  2,  8,  6,  18, 20, 26, 24, 1,  3,  9,  5,  11, 7,
                                 17, 15, 19, 21, 23, 25, 4,  10, 12, 14, 16, 22, 13};

static void put_int(FILE *f, const Form *o, long v, int bytes)
{
  const int       four  = (int)v;
  const long long eight = v;

  if (!o->binary) fprintf(f, "%ld ", v);
  else assert_int_equal(bytes == 4 ? fwrite(&four, 4, 1, f) : fwrite(&eight, 8, 1, f), 1);
}

static void put_real(FILE *f, const Form *o, double v)
{
  if (!o->binary) fprintf(f, "%.17g ", v);
  else assert_int_equal(fwrite(&v, 8, 1, f), 1);
}

/* Gmsh's number of a type */
static int type_of(PetscInt dim, PetscInt order)
{
  const int type[3][3] = {{8, 1, 8}, {16, 3, 10}, {17, 5, 12}};

  return type[dim - 1][order == -2 ? 0 : order];
}

static PetscInt nodes_of(PetscInt dim, PetscInt order)
{
  const PetscInt n[3][3] = {{3, 2, 3}, {8, 4, 9}, {20, 8, 27}};

  return n[dim - 1][order == -2 ? 0 : order];
}

/* Lattice place of node i of face `side` of a cell */
static PetscInt face_place(PetscInt dim, PetscInt side, PetscInt i)
{
  const PetscInt stride[3] = {1, 3, 9}, axis = side / 2, a = axis == 0 ? 1 : 0, b = axis == 2 ? 1 : 2,
                 line[3] = {0, 2, 1};
  const PetscInt in      = dim == 2 ? line[i] : QUAD[i];

  return side % 2 * 2 * stride[axis] + in % 3 * stride[a] + in / 3 * stride[b];
}

typedef struct {
  Mesh             m;
  const MeshLocal *l;
  const Form      *o;
  PetscInt         nboundary, nface;
  PetscInt        *face; /* [nface][3]: cell, side, boundary */
} Writer;

static void find_faces(Writer *w)
{
  const MeshLocal *l = w->l;
  PetscBool       *on;

  OK(PetscMalloc1(3 * 2 * l->dim * l->ncell, &w->face));
  OK(PetscMalloc1(l->nnode_all, &on));
  for (PetscInt b = 0; b < w->nboundary; b++) {
    const PetscInt *node;
    PetscInt        n;

    OK(MeshGetBoundaryNodes(w->m, b, &n, &node));
    for (PetscInt i = 0; i < l->nnode_all; i++) on[i] = PETSC_FALSE;
    for (PetscInt i = 0; i < n; i++) on[node[i]] = PETSC_TRUE;
    for (PetscInt k = 0; k < 2 * l->dim * l->ncell && b != w->o->nameless; k++) {
      PetscBool all = PETSC_TRUE;

      for (PetscInt i = 0; i < nodes_of(l->dim - 1, 2); i++)
        all = (PetscBool)(all && on[l->cell_node[k / (2 * l->dim) * l->nb + face_place(l->dim, k % (2 * l->dim), i)]]);
      if (!all) continue;
      w->face[3 * w->nface]       = k / (2 * l->dim);
      w->face[3 * w->nface + 1]   = k % (2 * l->dim);
      w->face[3 * w->nface++ + 2] = b;
    }
  }
  OK(PetscFree(on));
}

static long tag_of(const Writer *w, PetscInt node)
{
  return (long)((w->l->node_global[node] + 1) * w->o->stretch);
}

/* The nodes of a cell, turned if it is one of those */
static void put_cell_nodes(FILE *f, const Writer *w, PetscInt c)
{
  const MeshLocal *l    = w->l;
  const PetscBool  turn = (PetscBool)(w->o->turned && l->cell_global[c] % w->o->turned == 0);

  for (PetscInt i = 0; i < nodes_of(l->dim, w->o->order); i++) {
    const PetscInt j = l->dim == 2 ? QUAD[i] : HEX[i];

    put_int(f, w->o, tag_of(w, l->cell_node[c * l->nb + (turn ? j / 9 * 9 + j % 3 * 3 + j / 3 % 3 : j)]),
            w->o->version < 4.05 ? 4 : 8);
  }
  if (!w->o->binary) fprintf(f, "\n");
}

static void put_face_nodes(FILE *f, const Writer *w, PetscInt i)
{
  const PetscInt *face = w->face + 3 * i;

  for (PetscInt k = 0; k < nodes_of(w->l->dim - 1, w->o->order); k++)
    put_int(f, w->o, tag_of(w, w->l->cell_node[face[0] * w->l->nb + face_place(w->l->dim, face[1], k)]),
            w->o->version < 4.05 ? 4 : 8);
  if (!w->o->binary) fprintf(f, "\n");
}

/* Nodes, places, elements of one rank */
static void put_nodes(FILE *f, const Writer *w)
{
  const MeshLocal *l  = w->l;
  const int        v4 = w->o->version >= 4, newest = w->o->version > 4.05;

  if (newest) put_int(f, w->o, (long)l->dim, 4);
  if (v4) put_int(f, w->o, 1, 4);
  if (v4 && !newest) put_int(f, w->o, (long)l->dim, 4);
  if (v4) put_int(f, w->o, 0, 4);
  if (v4) put_int(f, w->o, (long)l->nnode, 8);
  for (PetscInt i = 0; i < l->nnode && newest; i++) put_int(f, w->o, tag_of(w, i), 8);
  for (PetscInt i = 0; i < l->nnode; i++) {
    if (!newest) put_int(f, w->o, tag_of(w, i), 4);
    for (PetscInt d = 0; d < 3; d++) put_real(f, w->o, d < l->dim ? (double)l->x[i * l->dim + d] : 0);
    if (!w->o->binary) fprintf(f, "\n");
  }
}

/* Of boundary b, or the cells if it is the number of boundaries; groups have numbers 10 + b, 7 */
static void put_elements(FILE *f, const Writer *w, PetscInt b)
{
  const PetscInt cells = b == w->nboundary, dim = w->l->dim - !cells, n = cells ? w->l->ncell : w->nface;
  const int      v4 = w->o->version >= 4, newest = w->o->version > 4.05, type = type_of(dim, w->o->order);
  PetscInt       mine = cells ? n : 0;

  for (PetscInt i = 0; i < n && !cells; i++) mine += w->face[3 * i + 2] == b;
  if (v4) put_int(f, w->o, (long)(newest ? dim : b + 1), 4);
  if (v4) put_int(f, w->o, (long)(newest ? b + 1 : dim), 4);
  if (v4) put_int(f, w->o, type, 4);
  if (v4) put_int(f, w->o, (long)mine, 8);
  for (PetscInt i = 0; i < n; i++) {
    if (!cells && w->face[3 * i + 2] != b) continue;
    if (!v4 && w->o->binary) {
      put_int(f, w->o, type, 4);
      put_int(f, w->o, 1, 4);
      put_int(f, w->o, 2, 4);
    }
    put_int(f, w->o, (long)i + 1, newest ? 8 : 4);
    if (!v4 && !w->o->binary) put_int(f, w->o, type, 4);
    if (!v4 && w->o->version >= 2 && !w->o->binary) put_int(f, w->o, 2, 4);
    if (!v4) put_int(f, w->o, w->o->groups == 0 ? 0 : cells ? 7 : 10 + b, 4);
    if (!v4) put_int(f, w->o, (long)b + 1, 4);
    if (w->o->version < 2) put_int(f, w->o, (long)nodes_of(dim, w->o->order), 4);
    if (cells) put_cell_nodes(f, w, i);
    else put_face_nodes(f, w, i);
  }
}

static void put_header(FILE *f, const Writer *w)
{
  const Form    *o  = w->o;
  const PetscInt nb = w->nboundary, dim = w->l->dim;
  const int      one = 1;

  if (o->version >= 2) fprintf(f, "$MeshFormat\n%g %d 8\n", o->version, (int)o->binary);
  if (o->binary) assert_int_equal(fwrite(&one, 4, 1, f), 1);
  if (o->version >= 2) fprintf(f, "%s$EndMeshFormat\n", o->binary ? "\n" : "");
  if (o->groups == 2) {
    fprintf(f, "$PhysicalNames\n%d\n", (int)nb + 1);
    for (PetscInt b = 0; b < nb; b++) {
      const char *name;

      OK(MeshGetBoundaryName(w->m, b, &name));
      fprintf(f, "%d %d \"%s\"\n", (int)dim - 1, (int)(10 + b), name);
    }
    fprintf(f, "%d 7 \"the fluid\"\n$EndPhysicalNames\n", (int)dim);
  }
  if (o->version < 4) return;
  fprintf(f, "$Entities\n");
  for (PetscInt d = 0; d < 4; d++) put_int(f, o, d == dim - 1 ? (long)nb : d == dim, 8);
  for (PetscInt b = 0; b <= nb; b++) {
    put_int(f, o, (long)b + 1, 4);
    for (PetscInt d = 0; d < 6; d++) put_real(f, o, 0);
    put_int(f, o, o->groups != 0, 8);
    if (o->groups) put_int(f, o, b == nb ? 7 : -(10 + (long)b), 4); /* the other way round */
    put_int(f, o, 0, 8);
    if (!o->binary) fprintf(f, "\n");
  }
  fprintf(f, "\n$EndEntities\n");
}

/* Collective: every rank writes its part in its turn */
static inline void write_mesh(Mesh m, const Form *form, const char path[])
{
  Writer                   w = {.m = m, .o = form};
  PetscMPIInt              rank, size;
  PetscInt                 nface;
  const char *const        nodes    = form->version < 2 ? "NOD" : "Nodes",
                    *const elements = form->version < 2 ? "ELM" : "Elements",
                    *const end      = form->version < 2 ? "END" : "End";

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  OK(MeshGetLocal(m, &w.l));
  OK(MeshGetBoundaryCount(m, &w.nboundary));
  find_faces(&w);
  nface = (PetscInt)total((PetscReal)w.nface);
  for (PetscInt turn = 0; turn < (w.nboundary + 2) * size; turn++) {
    const PetscInt part = turn / size; /* nodes, boundaries, cells */

    if (turn % size == rank) {
      FILE *f = fopen(path, turn ? "ab" : "wb");

      assert_non_null(f);
      if (turn == 0) put_header(f, &w);
      if (turn == 0) fprintf(f, "$%s\n", nodes);
      if (turn == 0 && form->version >= 4) put_int(f, form, size, 8);
      if (turn == 0 && form->version >= 4) put_int(f, form, (long)w.l->nnode_global, 8);
      if (turn == 0 && form->version > 4.05) put_int(f, form, 1, 8);
      if (turn == 0 && form->version > 4.05) put_int(f, form, (long)(w.l->nnode_global * form->stretch), 8);
      if (turn == 0 && form->version < 4) fprintf(f, "%d\n", (int)w.l->nnode_global);
      if (turn == size) fprintf(f, "\n$%s%s\n$%s\n", end, nodes, elements);
      if (turn == size && form->version >= 4) put_int(f, form, (long)size * (w.nboundary + 1), 8);
      if (turn == size && form->version >= 4) put_int(f, form, (long)(w.l->ncell_global + nface), 8);
      if (turn == size && form->version > 4.05) put_int(f, form, 1, 8);
      if (turn == size && form->version > 4.05) put_int(f, form, 1, 8);
      if (turn == size && form->version < 4) fprintf(f, "%d\n", (int)(w.l->ncell_global + nface));
      if (part == 0) put_nodes(f, &w);
      else put_elements(f, &w, part - 1);
      if (turn == (w.nboundary + 2) * size - 1) fprintf(f, "\n$%s%s\n", end, elements);
      assert_int_equal(fclose(f), 0);
    }
    OK(MPI_Barrier(PETSC_COMM_WORLD));
  }
  OK(PetscFree(w.face));
}
