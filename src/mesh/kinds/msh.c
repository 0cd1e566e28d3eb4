/* Msh: the sections of a Gmsh file (see msh.h). The whole file is in memory; every reader stops at its end, and what
   follows a fault is not read. */
#include "compat.h"
#include "msh.h"
#include "mshtext.h"
#include <stdlib.h>
#include <string.h>

/* By Gmsh's number of the type */
static const MshType TYPES[] = {[1]  = {"lines", 1, 2, 1},
                                [2]  = {"triangles", 2, 3, 1},
                                [3]  = {"quadrilaterals", 2, 4, 1},
                                [4]  = {"tetrahedra", 3, 4, 1},
                                [5]  = {"hexahedra", 3, 8, 1},
                                [6]  = {"prisms", 3, 6, 1},
                                [7]  = {"pyramids", 3, 5, 1},
                                [8]  = {"lines", 1, 3, 2},
                                [9]  = {"triangles", 2, 6, 2},
                                [10] = {"quadrilaterals", 2, 9, 2},
                                [11] = {"tetrahedra", 3, 10, 2},
                                [12] = {"hexahedra", 3, 27, 2},
                                [13] = {"prisms", 3, 18, 2},
                                [14] = {"pyramids", 3, 14, 2},
                                [15] = {"points", 0, 1, 1},
                                [16] = {"quadrilaterals", 2, 8, 2},
                                [17] = {"hexahedra", 3, 20, 2},
                                [18] = {"prisms", 3, 15, 2},
                                [19] = {"pyramids", 3, 13, 2},
                                [20] = {"triangles", 2, 9, 3},
                                [21] = {"triangles", 2, 10, 3},
                                [22] = {"triangles", 2, 12, 4},
                                [23] = {"triangles", 2, 15, 4},
                                [24] = {"triangles", 2, 15, 5},
                                [25] = {"triangles", 2, 21, 5},
                                [26] = {"lines", 1, 4, 3},
                                [27] = {"lines", 1, 5, 4},
                                [28] = {"lines", 1, 6, 5},
                                [29] = {"tetrahedra", 3, 20, 3},
                                [30] = {"tetrahedra", 3, 35, 4},
                                [31] = {"tetrahedra", 3, 56, 5},
                                [36] = {"quadrilaterals", 2, 16, 3},
                                [37] = {"quadrilaterals", 2, 25, 4},
                                [38] = {"quadrilaterals", 2, 36, 5},
                                [39] = {"quadrilaterals", 2, 12, 3},
                                [40] = {"quadrilaterals", 2, 16, 4},
                                [92] = {"hexahedra", 3, 64, 3},
                                [93] = {"hexahedra", 3, 125, 4}};

static const MshType *find_type(MshText *t, PetscInt number)
{
  const PetscInt n = (PetscInt)(sizeof(TYPES) / sizeof(TYPES[0]));

  if (number >= 0 && number < n && TYPES[number].shape) return TYPES + number;
  MshFault(t,
           "has elements of type %" PetscInt_FMT
           " of Gmsh, which is not known here: save it with lines, quadrilaterals and hexahedra of order 1 or 2",
           number);
  return NULL;
}

/* Room for `more` items of this size behind the n that there are */
static PetscErrorCode reserve(PetscInt n, PetscInt more, size_t size, PetscInt *capacity, void *list)
{
  PetscFunctionBeginUser;
  if (n + more <= *capacity) PetscFunctionReturn(PETSC_SUCCESS);
  *capacity = PetscMax(n + more, 2 * *capacity);
  PetscCall(PetscRealloc(size * (size_t)*capacity, (void **)list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- groups and entities ---- */

static PetscErrorCode read_names(MshText *t, Msh *m)
{
  const PetscInt n = MshCount(t, MshNumber(t), 4);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n && !*t->fault; i++) {
    MshGroup *g;

    PetscCall(reserve(m->ngroup, 1, sizeof(MshGroup), &m->group_capacity, &m->group));
    g         = m->group + m->ngroup++;
    g->dim    = MshNumber(t);
    g->number = MshNumber(t);
    MshQuoted(t, g->name);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

const char *MshGroupName(const Msh *m, PetscInt dim, PetscInt number)
{
  for (PetscInt i = 0; i < m->ngroup; i++)
    if (m->group[i].dim == dim && m->group[i].number == number && m->group[i].name[0]) return m->group[i].name;
  return NULL;
}

/* One of dimension dim. split: with what it was before the mesh was cut into parts; 4.0 gives points a box too */
static PetscErrorCode read_entity(MshText *t, Msh *m, PetscInt dim, PetscBool split)
{
  MshEntity *e;
  PetscInt   n;

  PetscFunctionBeginUser;
  PetscCall(reserve(m->nentity, 1, sizeof(MshEntity), &m->entity_capacity, &m->entity));
  e  = m->entity + m->nentity++;
  *e = (MshEntity){.dim = dim, .number = MshInt(t)};
  if (split) {
    (void)MshInt(t);
    (void)MshInt(t);
    n = MshCount(t, MshSize(t), 1);
    for (PetscInt i = 0; i < n; i++) (void)MshInt(t);
  }
  for (PetscInt i = 0; i < (dim > 0 || t->version < 4.05 ? 6 : 3); i++) (void)MshReal(t);
  n = MshCount(t, MshSize(t), 1);
  for (PetscInt i = 0, k = 0; i < n; i++) {
    const PetscInt group = MshInt(t);

    if (k < 2 && group) e->group[k++] = PetscAbsInt(group); /* negative: the normal points the other way */
  }
  if (dim == 0) PetscFunctionReturn(PETSC_SUCCESS);
  n = MshCount(t, MshSize(t), 1);
  for (PetscInt i = 0; i < n; i++) (void)MshInt(t);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int compare_entities(const void *a, const void *b)
{
  const MshEntity *x = (const MshEntity *)a, *y = (const MshEntity *)b;

  if (x->dim != y->dim) return x->dim < y->dim ? -1 : 1;
  return x->number < y->number ? -1 : x->number > y->number;
}

static PetscErrorCode read_entities(MshText *t, Msh *m, PetscBool split)
{
  PetscInt n[4];

  PetscFunctionBeginUser;
  if (split) {
    PetscInt ghosts;

    m->nentity = 0; /* elements are told by the parts */
    (void)MshSize(t);
    ghosts = MshCount(t, MshSize(t), 2);
    for (PetscInt i = 0; i < 2 * ghosts; i++) (void)MshInt(t);
  }
  for (PetscInt d = 0; d < 4; d++) n[d] = MshCount(t, MshSize(t), 4);
  for (PetscInt d = 0; d < 4; d++)
    for (PetscInt i = 0; i < n[d] && !*t->fault; i++) PetscCall(read_entity(t, m, d, split));
  if (m->nentity) qsort(m->entity, (size_t)m->nentity, sizeof(MshEntity), compare_entities);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- nodes ---- */

static PetscErrorCode start_nodes(MshText *t, Msh *m, PetscInt n)
{
  PetscFunctionBeginUser;
  if (m->x) MshFault(t, "has its nodes twice");
  if (*t->fault) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(3 * n, &m->x));
  PetscCall(PetscMalloc2(n, &m->tag, n, &m->index));
  m->nnode = n;
  for (PetscInt i = 0; i < n; i++) m->tag[i] = i + 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_plain_nodes(MshText *t, Msh *m)
{
  const PetscInt n = MshCount(t, MshNumber(t), 4);

  PetscFunctionBeginUser;
  MshBody(t);
  PetscCall(start_nodes(t, m, n));
  for (PetscInt i = 0; i < n && !*t->fault; i++) {
    m->tag[i] = MshInt(t);
    for (PetscInt d = 0; d < 3; d++) m->x[3 * i + d] = MshReal(t);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By curves, surfaces, volumes: the numbers of an entity's nodes before their places (4.1), or each beside its place */
static PetscErrorCode read_block_nodes(MshText *t, Msh *m)
{
  const PetscBool newest = (PetscBool)(t->version > 4.05);
  const PetscInt  nblock = MshCount(t, MshSize(t), 4), n = MshCount(t, MshSize(t), 4);
  PetscInt        done = 0;

  PetscFunctionBeginUser;
  if (newest)
    for (PetscInt i = 0; i < 2; i++) (void)MshSize(t);
  PetscCall(start_nodes(t, m, n));
  for (PetscInt b = 0; b < nblock && !*t->fault; b++) {
    const PetscInt first = MshInt(t), second = MshInt(t), dim = newest ? first : second, parametric = MshInt(t),
                   count = MshCount(t, MshSize(t), 1);

    if (count > n - done) MshFault(t, "has more nodes than it says");
    for (PetscInt i = 0; i < count && newest && !*t->fault; i++) m->tag[done + i] = MshSize(t);
    for (PetscInt i = 0; i < count && !*t->fault; i++) {
      if (!newest) m->tag[done + i] = MshInt(t);
      for (PetscInt d = 0; d < 3; d++) m->x[3 * (done + i) + d] = MshReal(t);
      for (PetscInt d = 0; d < (parametric ? dim : 0); d++) (void)MshReal(t);
    }
    done += count;
  }
  if (done != n) MshFault(t, "has fewer nodes than it says");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_nodes(MshText *t, Msh *m)
{
  PetscFunctionBeginUser;
  if (t->version < 4) PetscCall(read_plain_nodes(t, m));
  else PetscCall(read_block_nodes(t, m));
  if (*t->fault) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < m->nnode; i++) m->index[i] = i;
  PetscCall(PetscSortIntWithArray(m->nnode, m->tag, m->index));
  for (PetscInt i = 1; i < m->nnode; i++)
    if (m->tag[i] == m->tag[i - 1]) MshFault(t, "has two nodes of number %" PetscInt_FMT, m->tag[i]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_node(MshText *t, const Msh *m, PetscInt number, PetscInt *node)
{
  PetscInt at = number - 1;

  PetscFunctionBeginUser;
  *node = -1;
  if (*t->fault) PetscFunctionReturn(PETSC_SUCCESS);
  if (at < 0 || at >= m->nnode || m->tag[at] != number) PetscCall(PetscFindInt(number, m->nnode, m->tag, &at));
  if (at < 0) MshFault(t, "has an element with node %" PetscInt_FMT ", which is not among its nodes", number);
  else *node = m->index[at];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- elements ---- */

static PetscErrorCode add_element(MshText *t, Msh *m, const MshElement *e, PetscBool long_numbers)
{
  PetscFunctionBeginUser;
  PetscCall(reserve(m->nelement, 1, sizeof(MshElement), &m->element_capacity, &m->element));
  PetscCall(reserve(m->nindex, e->type->nnode, sizeof(PetscInt), &m->index_capacity, &m->node));
  m->element[m->nelement]         = *e;
  m->element[m->nelement++].start = m->nindex;
  for (PetscInt i = 0; i < e->type->nnode; i++)
    PetscCall(find_node(t, m, long_numbers ? MshSize(t) : MshInt(t), m->node + m->nindex++));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Number, type, tags (the first two are the physical group and the entity; format 1 has those and the count of nodes),
   nodes; binary files say the type once for many */
static PetscErrorCode read_plain_elements(MshText *t, Msh *m)
{
  const PetscInt n = MshCount(t, MshNumber(t), 4);

  PetscFunctionBeginUser;
  MshBody(t);
  for (PetscInt i = 0; i < n && !*t->fault;) {
    MshElement e     = {0};
    PetscInt   count = 1, ntag = 3, type;

    if (!t->binary) e.number = MshInt(t);
    type   = MshInt(t);
    e.type = find_type(t, type);
    if (t->binary) count = MshInt(t);
    if (t->version >= 2) ntag = MshInt(t);
    if (!e.type || count < 1) break;
    for (PetscInt k = 0; k < count && !*t->fault; k++, i++) {
      if (t->binary) e.number = MshInt(t);
      e.group[0] = e.entity = 0;
      for (PetscInt j = 0; j < ntag && !*t->fault; j++) {
        const PetscInt tag = MshInt(t);

        if (j == 0) e.group[0] = PetscAbsInt(tag);
        if (j == 1) e.entity = tag;
      }
      PetscCall(add_element(t, m, &e, PETSC_FALSE));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_block_elements(MshText *t, Msh *m)
{
  const PetscBool newest = (PetscBool)(t->version > 4.05);
  const PetscInt  nblock = MshCount(t, MshSize(t), 4);

  PetscFunctionBeginUser;
  (void)MshSize(t);
  if (newest)
    for (PetscInt i = 0; i < 2; i++) (void)MshSize(t);
  for (PetscInt b = 0; b < nblock && !*t->fault; b++) {
    const PetscInt   first = MshInt(t), second = MshInt(t), type = MshInt(t), count = MshCount(t, MshSize(t), 1);
    const MshEntity  key  = {.dim = newest ? first : second, .number = newest ? second : first};
    const MshEntity *same = NULL;
    MshElement       e    = {.type = find_type(t, type), .entity = key.number};

    if (m->nentity)
      same = (const MshEntity *)bsearch(&key, m->entity, (size_t)m->nentity, sizeof(key), compare_entities);
    for (PetscInt k = 0; k < 2 && same; k++) e.group[k] = same->group[k];
    for (PetscInt i = 0; i < count && !*t->fault; i++) {
      e.number = newest ? MshSize(t) : MshInt(t);
      PetscCall(add_element(t, m, &e, newest));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the file ---- */

static PetscErrorCode read_section(MshText *t, Msh *m, const char name[])
{
  PetscFunctionBeginUser;
  if (!strcmp(name, "MeshFormat")) MshFormat(t);
  else if (!strcmp(name, "PhysicalNames")) PetscCall(read_names(t, m));
  else if (!strcmp(name, "Entities")) PetscCall(read_entities(t, m, PETSC_FALSE));
  else if (!strcmp(name, "PartitionedEntities")) PetscCall(read_entities(t, m, PETSC_TRUE));
  else if (!strcmp(name, "Nodes") || !strcmp(name, "NOD")) PetscCall(read_nodes(t, m));
  else if (!strcmp(name, "Elements") || !strcmp(name, "ELM"))
    PetscCall(t->version < 4 ? read_plain_elements(t, m) : read_block_elements(t, m));
  else if (!strcmp(name, "ParametricNodes"))
    MshFault(t,
             "has parametric nodes of format 2: save it in format 4.1 (gmsh -format msh41), or without Mesh.SaveParametric");
  else if (!strcmp(name, "Periodic"))
    m->periodic = (PetscBool)(t->binary && t->version >= 4 ? MshInt(t) != 0 : MshNumber(t) != 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MshRead(const char path[], Msh *m, char fault[MSH_FAULT])
{
  MshText t;
  char    name[MSH_NAME];

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(m, sizeof(*m)));
  PetscCall(MshOpen(path, fault, &t));
  while (!*fault && MshNextSection(&t, name)) {
    PetscCall(read_section(&t, m, name));
    MshEndSection(&t, name);
  }
  if (!*fault && !m->nelement) MshFault(&t, "has no elements: it is not a mesh file of Gmsh (.msh)");
  PetscCall(MshClose(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MshClear(Msh *m)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(m->x));
  PetscCall(PetscFree2(m->tag, m->index));
  PetscCall(PetscFree(m->node));
  PetscCall(PetscFree(m->element));
  PetscCall(PetscFree(m->group));
  PetscCall(PetscFree(m->entity));
  PetscFunctionReturn(PETSC_SUCCESS);
}
