/* Refined: see refined.h.

   A cell that shares a node with an own cell lies at most three layers of touching cells away from it: both may have
   the node as that of a large face beside them, and the two large cells touch. So three layers are looked at and
   those kept that share a node. The owner of a node is the rank of the first cell on the curve that has it (as in
   p4est: Isaac, Burstedde, Wilcox & Ghattas, SIAM J. Sci. Comput. 37, 2015); that cell is a ghost of every rank with
   the node on an own cell, and its owner tells the number. */
#include "compat.h"
#include "base/agree.h"
#include "refined.h"
#include "hangimpl.h"
#include "../kinds/kindimpl.h"
#include "../memory.h"
#include "../numbers.h"
#include "base/sparse.h"
#include "base/array.h"

#define LAYERS 3

typedef struct {
  Mesh      mesh;
  Leaves    leaves;
  PetscInt  nb, dim, nown, nall; /* cells */
  PetscInt  nghost, capacity;
  Leaf     *ghost;
  PetscInt *code;  /* [nall] HANG_CODE */
  PetscInt  nnode; /* local ones, in the order of being met */
  PetscInt *half;  /* [nnode][3] places on the lattice */
} Builder;

/* ---- one cell ---- */

static const Leaf *get_leaf(const Builder *b, PetscInt c)
{
  return c < b->nown ? b->leaves.leaf + c : b->ghost + (c - b->nown);
}

/* What hangs around a cell: bits of hangimpl.h */
static PetscErrorCode find_code(Builder *b, const Leaf *leaf, PetscInt *code)
{
  const PetscInt dim   = b->dim;
  PetscInt       child = 0, face = 0, edge = 0, out[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  *code = 0;
  if (!leaf->level) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < dim; a++) {
    child |= ((leaf->x[a] / LeavesWidth(&b->leaves, leaf->level)) & 1) << a;
    out[a] = (child >> a) & 1 ? 1 : -1;
  }
  for (PetscInt a = 0; a < dim; a++) {
    PetscInt step[3] = {0, 0, 0}, level;

    step[a] = out[a];
    PetscCall(LeavesLevelBeside(&b->leaves, leaf, step, &level));
    if (level >= 0 && level < leaf->level) face |= 1 << a;
  }
  for (PetscInt a = 0; a < dim && dim == 3; a++) {
    PetscInt step[3] = {out[0], out[1], out[2]}, level;

    step[a] = 0;
    if (face & ~(1 << a)) continue; /* the edge is part of a face that hangs */
    PetscCall(LeavesLevelBeside(&b->leaves, leaf, step, &level));
    if (level >= 0 && level < leaf->level) edge |= 1 << a;
  }
  if (face || edge) *code = HANG_CODE(child, face, edge);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Lattice position of the node in slot j */
static void slot_position(const Builder *b, const Leaf *leaf, PetscInt code, PetscInt j, PetscInt half[3])
{
  const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9}, w = LeavesWidth(&b->leaves, leaf->level);

  half[2] = 0;
  for (PetscInt a = 0; a < b->dim; a++) {
    const PetscInt n = 2 * b->leaves.cells[a];

    half[a] = 2 * leaf->x[a] + at[a] * w;
    if (code && HangStretched(b->dim, code, j, a)) half[a] += (code >> a) & 1 ? -(2 - at[a]) * w : at[a] * w;
    if (b->leaves.periodic[a]) half[a] = (half[a] + n) % n;
  }
}

static uint64_t node_key(const PetscInt half[3])
{
  return (uint64_t)half[0] | (uint64_t)half[1] << 21 | (uint64_t)half[2] << 42;
}

/* ---- ghosts ---- */

static PetscErrorCode add_ghost(Builder *b, const Leaf *leaf, Keys *seen)
{
  PetscInt found;

  PetscFunctionBeginUser;
  PetscCall(KeysAdd(seen, leaf->key, b->nghost, &found));
  if (found < b->nghost) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(b->nghost + 1, &b->capacity, &b->ghost, sizeof(*b->ghost), NULL));
  b->ghost[b->nghost++] = *leaf;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells of other ranks in three layers around the own ones; balance is checked on the way */
static PetscErrorCode list_layers(Builder *b)
{
  Keys        seen  = {0};
  PetscInt    first = 0;
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(b->leaves.comm, &rank));
  for (PetscInt layer = 0; layer < LAYERS; layer++) {
    const PetscInt from = first, last = layer ? b->nghost : b->nown;

    first = b->nghost;
    for (PetscInt i = from; i < last; i++) {
      const Leaf leaf = layer ? b->ghost[i] : b->leaves.leaf[i]; /* the list may move */
      Leaf       other[LEAVES_MAX_NEIGHBOURS];
      PetscInt   n;

      if (!layer && LeavesIsInner(&b->leaves, rank, &leaf)) {
        PetscCall(LeavesCheckBalance(&b->leaves, &leaf));
        continue;
      }
      PetscCall(LeavesNeighbours(&b->leaves, &leaf, &n, other));
      for (PetscInt k = 0; k < n; k++)
        if (LeavesOwner(&b->leaves, other[k].key) != rank) PetscCall(add_ghost(b, &other[k], &seen));
    }
  }
  PetscCall(KeysDestroy(&seen));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Keep those that share a node with an own cell, along the curve */
static PetscErrorCode choose_ghosts(Builder *b)
{
  Keys     own = {0};
  PetscInt n   = 0, half[3], found, code;

  PetscFunctionBeginUser;
  AgreeEnter();
  PetscCall(AgreeReturn(b->nown < b->leaves.total || b->leaves.levels ? list_layers(b) : PETSC_SUCCESS));
  if (!b->nghost) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt c = 0; c < b->nown; c++) {
    for (PetscInt j = 0; j < b->nb; j++) {
      slot_position(b, b->leaves.leaf + c, b->code[c], j, half);
      PetscCall(KeysAdd(&own, node_key(half), 0, &found));
    }
  }
  for (PetscInt i = 0; i < b->nghost; i++) {
    PetscBool shares = PETSC_FALSE;

    PetscCall(find_code(b, b->ghost + i, &code));
    for (PetscInt j = 0; j < b->nb && !shares; j++) {
      slot_position(b, b->ghost + i, code, j, half);
      shares = (PetscBool)(KeysFind(&own, node_key(half)) >= 0);
    }
    if (shares) b->ghost[n++] = b->ghost[i];
  }
  b->nghost = n;
  qsort(b->ghost, (size_t)n, sizeof(*b->ghost), LeavesCompare);
  PetscCall(KeysDestroy(&own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The first of ascending ranks [n] that is this one, which is among them */
static PetscErrorCode find_first(PetscInt n, const PetscMPIInt rank[], PetscMPIInt wanted, PetscInt *first)
{
  PetscInt high = n - 1;

  PetscFunctionBeginUser;
  *first = 0;
  while (*first < high) {
    const PetscInt middle = (*first + high) / 2;

    if (rank[middle] < wanted) *first = middle + 1;
    else high = middle;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the ghosts are at home, from their owners; they are sorted by rank, and so are answers */
static PetscErrorCode connect_ghosts(Builder *b, PetscSF *sf)
{
  PetscMPIInt  size, tag, *owner, *asks, *who;
  PetscInt     nasked, n, *answer, *index;
  uint64_t    *send, *key;
  PetscSFNode *remote;
  MPI_Comm     comm;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(b->leaves.comm, &size));
  PetscCall(PetscCommDuplicate(b->leaves.comm, &comm, &tag));
  PetscCall(PetscMalloc2(b->nghost, &send, b->nghost, &owner));
  for (PetscInt i = 0; i < b->nghost; i++) {
    send[i]  = b->ghost[i].key;
    owner[i] = LeavesOwner(&b->leaves, b->ghost[i].key);
  }
  PetscCall(SparseExchange(comm, tag, b->nghost, owner, sizeof(*send), send, &nasked, &key, &asks));
  PetscCall(PetscMalloc1(nasked, &answer));
  for (PetscInt i = 0; i < nasked; i++) {
    answer[i] = LeavesOwnIndex(&b->leaves, key[i]);
    PetscCheck(answer[i] >= 0, PETSC_COMM_SELF, PETSC_ERR_PLIB,
               "A rank asks for a cell that its owner does not have: ranks differ about the tree");
  }
  PetscCall(SparseExchange(comm, tag, nasked, asks, sizeof(*answer), answer, &n, &index, &who));
  PetscCall(PetscMalloc1(b->nghost, &remote));
  for (PetscInt e = 0, i = 0; e < n; e++, i++) { /* ranks answer in any order, each in that of its ghosts */
    if (!e || who[e] != who[e - 1]) PetscCall(find_first(b->nghost, owner, who[e], &i));
    remote[i].rank                    = who[e];
    remote[i].index                   = index[e];
    b->mesh->cell_global[b->nown + i] = (PetscInt)(b->leaves.total * who[e] / size) + index[e];
  }
  PetscCall(PetscSFCreate(b->leaves.comm, sf));
  PetscCall(PetscSFSetGraph(*sf, b->nown, b->nghost, NULL, PETSC_OWN_POINTER, remote, PETSC_OWN_POINTER));
  PetscCall(PetscFree2(send, owner));
  PetscCall(PetscFree(key));
  PetscCall(PetscFree(asks));
  PetscCall(PetscFree(answer));
  PetscCall(PetscFree(index));
  PetscCall(PetscFree(who));
  PetscCall(PetscCommDestroy(&comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- nodes ---- */

/* Numbers of nodes by their places: in a table of all places where one rank has equal cells, else by keys */
typedef struct {
  Keys      keys;
  PetscInt *table, n[3]; /* [n[2]][n[1]][n[0]], -1: none yet; NULL: keys */
} Nodes;

static PetscErrorCode create_nodes(const Builder *b, Nodes *nodes)
{
  size_t size = 1;

  PetscFunctionBeginUser;
  *nodes = (Nodes){0};
  if (b->leaves.levels || b->nown < b->leaves.total) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++) {
    nodes->n[a] = a < b->dim ? 2 * b->leaves.cells[a] + 1 : 1;
    size *= (size_t)nodes->n[a];
  }
  PetscCall(PetscMalloc1(size, &nodes->table));
  for (size_t i = 0; i < size; i++) nodes->table[i] = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Number of the node at a place: `next` if it is new */
static PetscErrorCode number_node(Nodes *nodes, const PetscInt half[3], PetscInt next, PetscInt *number)
{
  PetscInt *at;

  PetscFunctionBeginUser;
  if (!nodes->table) {
    PetscCall(KeysAdd(&nodes->keys, node_key(half), next, number));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  at = nodes->table + ((size_t)half[2] * (size_t)nodes->n[1] + (size_t)half[1]) * (size_t)nodes->n[0] + (size_t)half[0];
  if (*at < 0) *at = next;
  *number = *at;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* cell_node in the order of being met; mine [nnode]: whether this rank owns a node of an own cell, -1: nobody here
   knows */
static PetscErrorCode meet_nodes(Builder *b, PetscInt *mine[])
{
  const uint64_t begin    = b->leaves.leaf[0].key;
  PetscInt       capacity = 0;
  Nodes          nodes;

  PetscFunctionBeginUser;
  *mine = NULL;
  PetscCall(create_nodes(b, &nodes));
  for (PetscInt c = 0; c < b->nall; c++) {
    const Leaf *leaf = get_leaf(b, c);

    for (PetscInt j = 0; j < b->nb; j++) {
      PetscInt half[3], *at = b->mesh->cell_node + c * b->nb + j;

      slot_position(b, leaf, b->code[c], j, half);
      PetscCall(number_node(&nodes, half, b->nnode, at));
      if (*at == b->nnode) {
        PetscCall(ArrayReserve(b->nnode + 1, &capacity, &b->half, 3 * sizeof(PetscInt), mine, sizeof(PetscInt), NULL));
        PetscCall(PetscArraycpy(b->half + 3 * b->nnode, half, 3));
        (*mine)[b->nnode++] = c < b->nown ? 1 : -1;
      }
      if (c >= b->nown && leaf->key < begin && (*mine)[*at] > 0) (*mine)[*at] = 0;
    }
  }
  PetscCall(KeysDestroy(&nodes.keys));
  PetscCall(PetscFree(nodes.table));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own nodes first */
static PetscErrorCode number_locally(Builder *b)
{
  MeshLocal *l = &b->mesh->loc;
  PetscInt  *mine, *number, *half;

  PetscFunctionBeginUser;
  PetscCall(meet_nodes(b, &mine));
  PetscCall(PetscMalloc1(b->nnode, &number));
  PetscCall(PetscMalloc1(3 * b->nnode, &half));
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt i = 0; i < b->nnode; i++)
      if ((mine[i] > 0) == (pass == 0)) number[i] = l->nnode_all++;
    if (pass == 0) l->nnode = l->nnode_all;
  }
  for (PetscInt i = 0; i < b->nnode; i++) PetscCall(PetscArraycpy(half + 3 * number[i], b->half + 3 * i, 3));
  for (PetscInt i = 0; i < b->nall * b->nb; i++) b->mesh->cell_node[i] = number[b->mesh->cell_node[i]];
  PetscCall(PetscFree(b->half));
  PetscCall(PetscFree(mine));
  PetscCall(PetscFree(number));
  b->half = half;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Numbers travel with the cells: first those of nodes that the owner of a cell owns, then all of its own cells */
static PetscErrorCode number_globally(Builder *b)
{
  MeshLocal     *l  = &b->mesh->loc;
  const PetscInt nb = b->nb;
  PetscInt       start, *global = NULL, *cell, missing = 0;
  PetscSF        sf;
  MPI_Datatype   row;

  PetscFunctionBeginUser;
  PetscCall(NumbersSpread(b->leaves.comm, "nodes", l->nnode, l->dim, &start, &l->nnode_global));
  l->node_start = start;
  PetscCall(PetscMalloc1(l->nnode_all, &b->mesh->node_global));
  global = b->mesh->node_global;
  for (PetscInt i = 0; i < l->nnode_all; i++) global[i] = i < l->nnode ? start + i : -1;
  PetscCall(connect_ghosts(b, &sf));
  PetscCallMPI(MPI_Type_contiguous((int)nb, MPIU_INT, &row));
  PetscCallMPI(MPI_Type_commit(&row));
  PetscCall(PetscMalloc1(b->nall * nb, &cell));
  for (PetscInt round = 0; round < 2; round++) {
    for (PetscInt i = 0; i < b->nown * nb; i++) cell[i] = global[b->mesh->cell_node[i]];
    PetscCall(PetscSFBcastBegin(sf, row, cell, cell + b->nown * nb, MPI_REPLACE));
    PetscCall(PetscSFBcastEnd(sf, row, cell, cell + b->nown * nb, MPI_REPLACE));
    for (PetscInt i = b->nown * nb; i < b->nall * nb; i++)
      if (cell[i] >= 0) global[b->mesh->cell_node[i]] = cell[i];
  }
  for (PetscInt i = 0; i < l->nnode_all; i++) missing += global[i] < 0;
  PetscCheck(!missing, PETSC_COMM_SELF, PETSC_ERR_PLIB, "%" PetscInt_FMT " nodes of a refined mesh have no number",
             missing);
  PetscCallMPI(MPI_Type_free(&row));
  PetscCall(PetscSFDestroy(&sf));
  PetscCall(PetscFree(cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- geometry ---- */

static PetscErrorCode place_nodes(Builder *b)
{
  MeshLocal     *l   = &b->mesh->loc;
  const PetscInt dim = b->dim;
  PetscReal      h   = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all * dim, &b->mesh->x));
  for (PetscInt i = 0; i < l->nnode_all; i++)
    PetscCall(LeavesPosition(&b->leaves, b->half + 3 * i, b->mesh->x + dim * i));
  for (PetscInt d = 0; d < dim; d++) {
    l->lower[d]  = b->leaves.kind->lower[d];
    l->upper[d]  = b->leaves.kind->upper[d];
    l->period[d] = b->leaves.kind->period[d];
  }
  for (PetscInt c = 0; c < b->nown; c++) {
    const Leaf *leaf   = b->leaves.leaf + c;
    PetscReal   volume = 1, lower[3], upper[3];
    PetscInt    lo[3], hi[3];

    for (PetscInt d = 0; d < dim; d++) {
      lo[d] = 2 * leaf->x[d];
      hi[d] = lo[d] + 2 * LeavesWidth(&b->leaves, leaf->level);
    }
    PetscCall(LeavesPosition(&b->leaves, lo, lower));
    PetscCall(LeavesPosition(&b->leaves, hi, upper));
    for (PetscInt d = 0; d < dim; d++) volume *= upper[d] - lower[d];
    h = PetscMin(h, PetscPowReal(volume, 1.0 / (PetscReal)dim));
  }
  PetscCallMPI(MPI_Allreduce(&h, &l->h, 1, MPIU_REAL, MPIU_MIN, b->leaves.comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Boundaries are the sides of the box that are not periodic, in the order of DOMAIN_SIDE */
static PetscErrorCode collect_boundaries(Builder *b)
{
  Mesh     m  = b->mesh;
  PetscInt at = 0;

  PetscFunctionBeginUser;
  PetscCall(MeshKindGetBoundaries(m->kind, &m->nboundary, &m->boundary_name));
  PetscCall(PetscCalloc2(m->nboundary, &m->boundary_node, m->nboundary, &m->boundary_count));
  for (PetscInt side = 0; side < 2 * b->dim; side++) {
    const PetscInt a = side / 2, where = side % 2 ? 2 * b->leaves.cells[a] : 0;

    if (b->leaves.periodic[a]) continue;
    for (PetscInt i = 0; i < m->loc.nnode_all; i++) m->boundary_count[at] += b->half[3 * i + a] == where;
    PetscCall(PetscMalloc1(m->boundary_count[at], &m->boundary_node[at]));
    for (PetscInt i = 0, n = 0; i < m->loc.nnode_all; i++)
      if (b->half[3 * i + a] == where) m->boundary_node[at][n++] = i;
    at++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Slots of cell c that hang: new ones in `seen` with this value; *n counts them */
static PetscErrorCode note_hanging(const Builder *b, PetscInt c, Keys *seen, PetscInt *n)
{
  const MeshHang *h = b->mesh->hang[c];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; h && i < h->n; i++) {
    const PetscInt before = seen->n;
    PetscInt       half[3], found;

    if (h->start[i + 1] - h->start[i] == 1) continue; /* a node, but of another slot */
    slot_position(b, get_leaf(b, c), 0, h->slot[i], half);
    PetscCall(KeysAdd(seen, node_key(half), 0, &found));
    *n += seen->n - before;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How many places hang, on all ranks, each once: by the first cell on the curve that has it */
static PetscErrorCode count_hanging(Builder *b)
{
  Keys     seen = {0};
  PetscInt n    = 0;

  PetscFunctionBeginUser;
  for (PetscInt c = b->nown; c < b->nall; c++)
    if (get_leaf(b, c)->key < b->leaves.leaf[0].key) PetscCall(note_hanging(b, c, &seen, &n));
  n = 0;
  for (PetscInt c = 0; c < b->nown; c++) PetscCall(note_hanging(b, c, &seen, &n));
  PetscCall(KeysDestroy(&seen));
  PetscCall(MPIU_Allreduce(&n, &b->mesh->hanging, 1, MPIU_INT, MPI_SUM, b->leaves.comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode attach_hanging(Builder *b)
{
  Mesh m = b->mesh;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(MESH_HANG_CODES, &m->hang_table));
  PetscCall(PetscCalloc1(b->nall, &m->hang));
  for (PetscInt c = 0; c < b->nall; c++) {
    const PetscInt code = b->code[c];

    if (!code) continue;
    if (!m->hang_table[code]) {
      PetscCall(PetscNew(&m->hang_table[code]));
      HangCreate(b->dim, code, m->hang_table[code]);
    }
    m->hang[c] = m->hang_table[code];
  }
  PetscCall(count_hanging(b));
  m->loc.hang = (const MeshHang *const *)m->hang;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode count_levels(Builder *b)
{
  Mesh m = b->mesh;

  PetscFunctionBeginUser;
  m->levels = b->leaves.levels;
  PetscCall(PetscCalloc1(m->levels + 1, &m->level_count));
  for (PetscInt c = 0; c < b->nown; c++) m->level_count[b->leaves.leaf[c].level]++;
  PetscCall(
    MPIU_Allreduce(MPI_IN_PLACE, m->level_count, (PetscMPIInt)(m->levels + 1), MPIU_INT, MPI_SUM, b->leaves.comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- all of it ---- */

static PetscErrorCode build_cells(Builder *b)
{
  MeshLocal *l = &b->mesh->loc;
  Mesh       m = b->mesh;

  PetscFunctionBeginUser;
  b->dim  = b->leaves.dim;
  b->nb   = b->dim == 2 ? 9 : 27;
  b->nown = b->leaves.nleaf;
  PetscCall(PetscMalloc1(b->nown, &b->code));
  for (PetscInt c = 0; c < b->nown; c++) PetscCall(find_code(b, b->leaves.leaf + c, &b->code[c]));
  PetscCall(choose_ghosts(b));
  b->nall = b->nown + b->nghost;
  PetscCall(PetscRealloc((size_t)b->nall * sizeof(PetscInt), &b->code));
  for (PetscInt i = 0; i < b->nghost; i++) PetscCall(find_code(b, b->ghost + i, &b->code[b->nown + i]));
  l->dim          = b->dim;
  l->nb           = b->nb;
  l->ncell        = b->nown;
  l->ncell_all    = b->nall;
  l->cell_start   = b->leaves.start;
  l->ncell_global = (PetscInt)b->leaves.total;
  PetscCall(PetscMalloc2(b->nall * b->nb, &m->cell_node, b->nall, &m->cell_global));
  for (PetscInt c = 0; c < b->nown; c++) m->cell_global[c] = l->cell_start + c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What a refined mesh has beyond others */
static PetscErrorCode keep_tree(Builder *b)
{
  PetscFunctionBeginUser;
  PetscCall(attach_hanging(b));
  PetscCall(count_levels(b));
  PetscCall(LeavesClose(&b->leaves));
  b->mesh->half = b->half;
  PetscCall(PetscNew(&b->mesh->leaves));
  *b->mesh->leaves = b->leaves;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefinedBuild(Mesh m, Leaves *leaves)
{
  Builder        b = {.mesh = m, .leaves = *leaves};
  const PetscInt d = m->kind->dim;

  PetscFunctionBeginUser;
  PetscCall(MeshCheckMemory(m->comm, d, (PetscReal)b.leaves.total));
  PetscCall(build_cells(&b));
  PetscCall(number_locally(&b));
  PetscCall(number_globally(&b));
  PetscCall(MeshConnectNodes(m));
  PetscCall(place_nodes(&b));
  PetscCall(collect_boundaries(&b));
  if (leaves->levels) {
    PetscCall(keep_tree(&b));
  } else { /* equal cells are as good as any others */
    PetscCall(PetscFree(b.half));
    PetscCall(LeavesDestroy(&b.leaves));
  }
  PetscCall(PetscFree(b.ghost));
  PetscCall(PetscFree(b.code));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RefinedDestroy(Mesh m)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < MESH_HANG_CODES && m->hang_table; i++) PetscCall(PetscFree(m->hang_table[i]));
  PetscCall(PetscFree(m->hang_table));
  PetscCall(PetscFree(m->hang));
  PetscCall(PetscFree(m->level_count));
  PetscCall(PetscFree(m->half));
  if (m->leaves) PetscCall(LeavesDestroy(m->leaves));
  PetscCall(PetscFree(m->leaves));
  PetscFunctionReturn(PETSC_SUCCESS);
}
