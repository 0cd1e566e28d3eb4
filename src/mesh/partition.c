/* Partition of the mesh with METIS, k-way (Karypis & Kumar, SIAM J. Sci. Comput. 20, 1998), minimising the edge cut of
   the dual graph.

   PETSc keeps the operations of a partitioner in a private header. The public way to bring one's own is the type
   "shell", which holds a partition that was computed beforehand. So PartitionPrepare computes the partition and
   composes it with the partitioner object; the constructor registered as "metis" turns the object into a shell that
   holds the composed partition. It can therefore run as often as options are read (DMSetFromOptions sets the type
   again) without losing the partition. -petscpartitioner_view shows type shell. Does not weight cells, and does not
   repartition a running simulation. */
#include "partition.h"
#include "compat.h"
#include <metis.h>

#define PARTITION_METIS  "metis"
#define PARTITION_SIZES  "tumble_partition_sizes"  /* IS: number of local cells for each rank */
#define PARTITION_POINTS "tumble_partition_points" /* IS: local cells, grouped by the rank they go to */

/* The best of several cuts, at most 1 % more cells than the mean: with METIS' own 3 % the cut is hardly shorter */
#define METIS_CUTS      4
#define METIS_IMBALANCE 10 /* in 1/1000 */

/* Values of all ranks, one after the other, on rank 0 */
typedef struct {
  PetscMPIInt *count, *offset; /* [size] values of each rank, and where they start */
  PetscInt     n;
  PetscInt    *v; /* [n] */
} Gathered;

static PetscErrorCode gather_on_root(MPI_Comm comm, PetscInt n, const PetscInt v[], Gathered *g)
{
  PetscMPIInt size, nsend;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCall(PetscMPIIntCast(n, &nsend));
  PetscCall(PetscCalloc2(size, &g->count, size, &g->offset));
  PetscCallMPI(MPI_Gather(&nsend, 1, MPI_INT, g->count, 1, MPI_INT, 0, comm));
  g->n = 0;
  for (PetscMPIInt r = 0; r < size; r++) { /* counts are zero on all ranks but 0 */
    PetscCall(PetscMPIIntCast(g->n, &g->offset[r]));
    g->n += g->count[r];
  }
  PetscCall(PetscMalloc1(g->n, &g->v));
  PetscCallMPI(MPI_Gatherv(v, nsend, MPIU_INT, g->v, g->count, g->offset, MPIU_INT, 0, comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode free_gathered(Gathered *g)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree2(g->count, g->offset));
  PetscCall(PetscFree(g->v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* How many of nparts parts have no member */
static PetscErrorCode count_empty(idx_t n, const idx_t part[], idx_t nparts, PetscInt *empty)
{
  PetscBool *used;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(nparts, &used));
  for (idx_t i = 0; i < n; i++) used[part[i]] = PETSC_TRUE;
  *empty = 0;
  for (idx_t p = 0; p < nparts; p++) *empty += !used[p];
  PetscCall(PetscFree(used));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cut a graph into nparts; *empty of them got nothing, *code is the answer of METIS. On a graph with a few vertices for
   each part k-way leaves parts empty; recursive bisection does not. */
static PetscErrorCode call_metis(idx_t n, idx_t xadj[], idx_t adjncy[], idx_t nparts, idx_t part[], PetscInt *empty,
                                 PetscInt *code)
{
  idx_t options[METIS_NOPTIONS], one = 1, cut;

  PetscFunctionBeginUser;
  *empty = 0;
  *code  = METIS_SetDefaultOptions(options);
  if (*code != METIS_OK) PetscFunctionReturn(PETSC_SUCCESS);
  options[METIS_OPTION_NUMBERING] = 0;
  options[METIS_OPTION_SEED]      = 1; /* the same partition in every run */
  options[METIS_OPTION_NCUTS]     = METIS_CUTS;
  options[METIS_OPTION_UFACTOR]   = METIS_IMBALANCE;
  *code = METIS_PartGraphKway(&n, &one, xadj, adjncy, NULL, NULL, NULL, &nparts, NULL, NULL, options, &cut, part);
  if (*code != METIS_OK) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(count_empty(n, part, nparts, empty));
  if (*empty) {
    *code = METIS_PartGraphRecursive(&n, &one, xadj, adjncy, NULL, NULL, NULL, &nparts, NULL, NULL, options, &cut,
                                     part);
    if (*code == METIS_OK) PetscCall(count_empty(n, part, nparts, empty));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same for PETSc's integers: degree [n], neighbours one vertex after the other -> part [n] */
static PetscErrorCode cut_graph(const Gathered *degree, const Gathered *neighbour, PetscInt nparts, PetscInt part[],
                                PetscInt *empty, PetscInt *code)
{
  const PetscInt n = degree->n, nedge = neighbour->n;
  idx_t         *xadj, *adjncy, *where;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(n + 1, &xadj, nedge, &adjncy, n, &where));
  xadj[0] = 0;
  for (PetscInt i = 0; i < n; i++) xadj[i + 1] = xadj[i] + (idx_t)degree->v[i];
  for (PetscInt i = 0; i < nedge; i++) adjncy[i] = (idx_t)neighbour->v[i];
  PetscCall(call_metis((idx_t)n, xadj, adjncy, (idx_t)nparts, where, empty, code));
  for (PetscInt i = 0; i < n && *code == METIS_OK; i++) part[i] = where[i];
  PetscCall(PetscFree3(xadj, adjncy, where));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_empty(MPI_Comm comm, const char type[], PetscInt empty, PetscInt ncell)
{
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCheck(!empty, comm, PETSC_ERR_USER_INPUT,
             "Partitioner '%s' leaves %" PetscInt_FMT " of %d ranks without cells (the mesh has %" PetscInt_FMT
             " cells): use more cells (-mesh_cells), fewer ranks, or another -petscpartitioner_type",
             type, empty, size, ncell);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What rank 0 found out, told to all ranks so that they raise the same error */
static PetscErrorCode check_result(MPI_Comm comm, PetscInt ncell, PetscBool too_large, PetscInt empty, PetscInt code)
{
  PetscInt    result[4] = {ncell, too_large, empty, code};
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCallMPI(MPI_Bcast(result, 4, MPIU_INT, 0, comm));
  PetscCheck(result[0], comm, PETSC_ERR_ORDER,
             "The mesh has no cells yet: create it before its partitioner is prepared");
  PetscCheck(!result[1], comm, PETSC_ERR_USER_INPUT,
             "The graph of %" PetscInt_FMT
             " cells is too large for this METIS with %d-bit integers: change -petscpartitioner_type, for example to ptscotch",
             result[0], IDXTYPEWIDTH);
  PetscCall(check_empty(comm, PARTITION_METIS, result[2], result[0]));
  PetscCheck(result[3] == METIS_OK, comm, PETSC_ERR_LIB,
             "METIS failed with code %" PetscInt_FMT " on %" PetscInt_FMT
             " cells and %d ranks: change -petscpartitioner_type, for example to ptscotch",
             result[3], result[0], size);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rank of each of the nlocal own cells, part [nlocal], from the dual graph (CSR, global numbers) */
static PetscErrorCode compute_partition(MPI_Comm comm, PetscInt nlocal, const PetscInt start[],
                                        const PetscInt neighbour[], PetscInt part[])
{
  Gathered    degree, edges;
  PetscInt   *all, empty = 0, code = METIS_OK;
  PetscBool   too_large;
  PetscMPIInt size, rank, count;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  for (PetscInt i = 0; i < nlocal; i++) part[i] = start[i + 1] - start[i]; /* degrees first, there is space */
  PetscCall(gather_on_root(comm, nlocal, part, &degree));
  PetscCall(gather_on_root(comm, start[nlocal], neighbour, &edges));
  PetscCall(PetscMalloc1(degree.n, &all));
  too_large = (PetscBool)(edges.n > IDX_MAX || degree.n >= IDX_MAX);
  if (degree.n < size) empty = size - degree.n;
  else if (!rank && !too_large) PetscCall(cut_graph(&degree, &edges, size, all, &empty, &code));
  PetscCall(check_result(comm, degree.n, too_large, empty, code));
  PetscCall(PetscMPIIntCast(nlocal, &count));
  PetscCallMPI(MPI_Scatterv(all, degree.count, degree.offset, MPIU_INT, part, count, MPIU_INT, 0, comm));
  PetscCall(PetscFree(all));
  PetscCall(free_gathered(&degree));
  PetscCall(free_gathered(&edges));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sort the cells by rank and keep the two lists with the partitioner, where create_metis finds them */
static PetscErrorCode attach_partition(PetscPartitioner p, PetscInt n, const PetscInt part[])
{
  PetscInt   *sizes, *points, *next;
  PetscMPIInt size;
  IS          is_sizes, is_points;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)p), &size));
  PetscCall(PetscCalloc1(size, &sizes));
  PetscCall(PetscMalloc1(n, &points));
  PetscCall(PetscCalloc1(size + 1, &next));
  for (PetscInt i = 0; i < n; i++) sizes[part[i]]++;
  for (PetscMPIInt r = 0; r < size; r++) next[r + 1] = next[r] + sizes[r];
  for (PetscInt i = 0; i < n; i++) points[next[part[i]]++] = i;
  PetscCall(PetscFree(next));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, size, sizes, PETSC_OWN_POINTER, &is_sizes));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, n, points, PETSC_OWN_POINTER, &is_points));
  PetscCall(PetscObjectCompose((PetscObject)p, PARTITION_SIZES, (PetscObject)is_sizes));
  PetscCall(PetscObjectCompose((PetscObject)p, PARTITION_POINTS, (PetscObject)is_points));
  PetscCall(ISDestroy(&is_sizes));
  PetscCall(ISDestroy(&is_points));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Constructor of the type "metis" */
static PetscErrorCode create_metis(PetscPartitioner p)
{
  PetscObject     is_sizes, is_points;
  PetscInt        size;
  const PetscInt *sizes, *points;

  PetscFunctionBeginUser;
  PetscCall(PetscPartitionerSetType(p, PETSCPARTITIONERSHELL));
  PetscCall(PetscObjectQuery((PetscObject)p, PARTITION_SIZES, &is_sizes));
  PetscCall(PetscObjectQuery((PetscObject)p, PARTITION_POINTS, &is_points));
  if (!is_sizes) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ISGetLocalSize((IS)is_sizes, &size));
  PetscCall(ISGetIndices((IS)is_sizes, &sizes));
  PetscCall(ISGetIndices((IS)is_points, &points));
  PetscCall(PetscPartitionerShellSetPartition(p, size, sizes, points));
  PetscCall(ISRestoreIndices((IS)is_sizes, &sizes));
  PetscCall(ISRestoreIndices((IS)is_points, &points));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* An unknown type is an error that lists the known ones (PETSc's own message does not) */
static PetscErrorCode check_type(PetscPartitioner p, const char type[])
{
  const char **known;
  char         text[1024] = "";
  PetscBool    found      = PETSC_FALSE;
  int          n;

  PetscFunctionBeginUser;
  PetscCall(PetscFunctionListGet(PetscPartitionerList, &known, &n));
  for (int i = 0; i < n && !found; i++) {
    PetscCall(PetscStrcmp(known[i], type, &found));
    PetscCall(PetscStrlcat(text, i ? ", " : "", sizeof(text)));
    PetscCall(PetscStrlcat(text, known[i], sizeof(text)));
  }
  PetscCall(PetscFree(known));
  PetscCheck(found, PetscObjectComm((PetscObject)p), PETSC_ERR_USER_INPUT,
             "Partitioner '%s' is not known (known: %s): change -petscpartitioner_type", type, text);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode prepare_metis(DM dm, PetscPartitioner p)
{
  PetscInt n, *start, *neighbour, *part;

  PetscFunctionBeginUser;
  PetscCall(DMPlexCreatePartitionerGraph(dm, 0, &n, &start, &neighbour, NULL));
  PetscCall(PetscMalloc1(n, &part));
  PetscCall(compute_partition(PetscObjectComm((PetscObject)dm), n, start, neighbour, part));
  PetscCall(attach_partition(p, n, part));
  PetscCall(PetscFree(part));
  PetscCall(PetscFree(start));
  PetscCall(PetscFree(neighbour));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Make the type name "metis" known; it needs a partition made by PartitionPrepare */
static PetscErrorCode register_metis(void)
{
  PetscFunctionBeginUser;
  PetscCall(PetscPartitionerInitializePackage()); /* otherwise PETSc's own types are still missing from the list */
  PetscCall(PetscPartitionerRegister(PARTITION_METIS, create_metis));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The wanted type; read from the options, because a metis partitioner calls itself a shell */
static PetscErrorCode get_type(PetscPartitioner p, char type[], size_t len)
{
  const char *prefix;

  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(type, PARTITION_METIS, len));
  PetscCall(PetscObjectGetOptionsPrefix((PetscObject)p, &prefix));
  PetscCall(PetscOptionsGetString(NULL, prefix, "-petscpartitioner_type", type, len, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PartitionPrepare(DM dm)
{
  PetscPartitioner p;
  char             type[64];
  PetscBool        metis;
  PetscMPIInt      size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)dm), &size));
  PetscCall(register_metis());
  PetscCall(DMPlexGetPartitioner(dm, &p));
  PetscCall(get_type(p, type, sizeof(type)));
  PetscCall(check_type(p, type));
  PetscCall(PetscStrcmp(type, PARTITION_METIS, &metis));
  if (metis && size > 1) PetscCall(prepare_metis(dm, p));
  PetscCall(PetscPartitionerSetType(p, type));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PartitionCheck(DM dm)
{
  PetscPartitioner p;
  PetscSF          sf;
  PetscInt         cStart, cEnd, nleaf, result[2]; /* ranks without cells, cells */
  const PetscInt  *leaf;
  char             type[64];

  PetscFunctionBeginUser;
  PetscCall(DMPlexGetHeightStratum(dm, 0, &cStart, &cEnd));
  PetscCall(DMGetPointSF(dm, &sf));
  PetscCall(PetscSFGetGraph(sf, NULL, &nleaf, &leaf, NULL));
  result[1] = cEnd - cStart;
  for (PetscInt l = 0; l < nleaf; l++) { /* leaves are ghosts: owned by another rank */
    const PetscInt point = leaf ? leaf[l] : l;

    if (point >= cStart && point < cEnd) result[1]--;
  }
  result[0] = result[1] == 0;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, result, 2, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)dm)));
  PetscCall(DMPlexGetPartitioner(dm, &p));
  PetscCall(get_type(p, type, sizeof(type)));
  PetscCall(check_empty(PetscObjectComm((PetscObject)dm), type, result[0], result[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
