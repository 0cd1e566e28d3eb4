/* Summary in JSON: the file summary.json, entry by entry. */
#include "compat.h"
#include "summary.h"
#include "files.h"
#include "base/log.h"

const char *const SUMMARY_PHASE[] = {"setup", "nse", "force", "particle", "output", "mesh"};

static void print_string(FILE *f, const char text[])
{
  fputc('"', f);
  for (const char *c = text; *c; c++) {
    if (*c == '"' || *c == '\\') fputc('\\', f);
    if ((unsigned char)*c < 0x20) fprintf(f, "\\u%04x", (unsigned)*c);
    else fputc(*c, f);
  }
  fputc('"', f);
}

static void print_real(FILE *f, PetscReal value)
{
  if (PetscIsInfOrNanReal(value)) fprintf(f, "null");
  else fprintf(f, "%.12g", (double)value);
}

static void print_remarks(FILE *f)
{
  const char *const *text;
  PetscInt           n;

  (void)LogGetRemarks(&n, &text);
  fprintf(f, "  \"remarks\": [");
  for (PetscInt i = 0; i < n; i++) {
    fprintf(f, "%s\n    ", i ? "," : "");
    print_string(f, text[i]);
  }
  fprintf(f, "%s],\n", n ? "\n  " : "");
}

static void print_versions(FILE *f, const Versions *v)
{
  const char *const name[] = {"petsc", "mpi", "hypre", "hdf5"}, *const text[] = {v->petsc, v->mpi, v->hypre, v->hdf5};

  fprintf(f, "  \"commit\": \"%s\",\n  \"versions\": {\"tumble\": \"%s\"", v->commit, v->tumble);
  for (int i = 0; i < 4; i++) {
    if (!text[i][0]) continue;
    fprintf(f, ", \"%s\": ", name[i]);
    print_string(f, text[i]);
  }
  fprintf(f, "},\n");
}

/* Those the scene names */
static void print_units(FILE *f, Monitor m)
{
  static const char *const NAME[NUNITS] = {[UNIT_LENGTH] = "length", [UNIT_TIME] = "time", [UNIT_MASS] = "mass"};
  const char              *comma        = "";

  fprintf(f, "  \"units\": {");
  for (int i = 0; i < NUNITS; i++) {
    if (!m->unit[i][0]) continue;
    fprintf(f, "%s\"%s\": \"%s\"", comma, NAME[i], m->unit[i]);
    comma = ", ";
  }
  fprintf(f, "},\n");
}

static void print_seconds(FILE *f, const Summary *s)
{
  fprintf(f, "  \"seconds\": {");
  for (PetscInt i = 0; i < MONITOR_NPHASES; i++)
    if (SummaryShowsPhase(s, i)) fprintf(f, "\"%s\": %.6g, ", SUMMARY_PHASE[i], (double)s->seconds[i]);
  fprintf(f, "\"total\": %.6g},\n", (double)s->total);
}

static void print_balance(FILE *f, Monitor m)
{
  fprintf(f, "  \"balance\": {");
  for (PetscInt i = 0; i < m->balances.n; i++) {
    const Balance *b = m->balances.row + i;

    fprintf(f, "%s\n    \"%s\": {\"min\": %.12g, \"mean\": %.12g, \"max\": %.12g}", i ? "," : "", b->name,
            (double)b->min, (double)b->mean, (double)b->max);
  }
  fprintf(f, "%s},\n", m->balances.n ? "\n  " : "");
}

static void print_bandwidth(FILE *f, Monitor m)
{
  const Bandwidth *y = &m->bandwidth;

  if (!m->measured) return;
  fprintf(f, "  \"bandwidth\": {\"triad_one\": %.6g, \"triad_all\": %.6g, \"sweep\": %.6g, \"sweep_bytes\": %.12g},\n",
          (double)y->triad_one, (double)y->triad_all, (double)y->smoother, (double)y->smoother_bytes);
}

/* Every row, also those that never held: a column of series.csv counts them */
static void print_limits(FILE *f, Monitor m)
{
  fprintf(f, "  \"step_limits\": [");
  for (PetscInt i = 0; i < m->limits.n; i++) {
    const MonitorLimit *l = &m->limits.row[i];

    fprintf(f, "%s\n    {\"who\": ", i ? "," : "");
    print_string(f, l->name);
    fprintf(f, ", \"what\": ");
    print_string(f, l->what);
    fprintf(f, ", \"option\": ");
    print_string(f, l->option ? l->option : "");
    fprintf(f, ", \"value\": ");
    if (l->value < PETSC_MAX_REAL) print_real(f, l->value);
    else fprintf(f, "null");
    fprintf(f, ", \"unit\": ");
    print_string(f, l->unit);
    fprintf(f, ", \"then\": ");
    print_string(f, l->then);
    fprintf(f,
            ",\n     \"steps\": %" PetscInt_FMT ", \"refused\": %" PetscInt_FMT ", \"exceeded\": %" PetscInt_FMT
            ", \"dt_min\": ",
            l->steps, l->refused, l->exceeded);
    if (l->steps) print_real(f, l->dt_min);
    else fprintf(f, "null");
    fprintf(f, "}");
  }
  fprintf(f, "%s],\n", m->limits.n ? "\n  " : "");
}

static void print_quantities(FILE *f, Monitor m)
{
  fprintf(f, "  \"quantities\": {");
  for (PetscInt i = 0; i < m->nquantity; i++) {
    fprintf(f, "%s\n    ", i ? "," : "");
    print_string(f, m->quantity[i].name);
    fprintf(f, ": ");
    print_real(f, m->quantity[i].value);
  }
  fprintf(f, "%s}\n", m->nquantity ? "\n  " : "");
}

int SummaryWrite(Monitor m, const Summary *s, const char path[])
{
  FILE *f;
  int   err = FileBegin(path, &f);

  if (err) return err;
  fprintf(f, "{\n  \"scene\": ");
  print_string(f, s->scene);
  fprintf(f,
          ",\n  \"ranks\": %d,\n  \"cells\": %" PetscInt_FMT ",\n  \"unknowns\": %" PetscInt_FMT
          ",\n  \"bodies\": %" PetscInt_FMT ",\n  \"steps\": %" PetscInt_FMT,
          (int)m->size, s->cells, s->unknowns, m->bodies->nall, s->steps);
  fprintf(f, ",\n  \"time_end\": ");
  print_real(f, s->time_end);
  fprintf(f, ",\n");
  print_units(f, m);
  print_versions(f, &s->versions);
  fprintf(f, "  \"optimised\": %s,\n", s->versions.optimised ? "true" : "false");
  print_seconds(f, s);
  fprintf(f, "  \"outer_iterations\": {\"mean\": %.6g, \"max\": %" PetscInt_FMT "},\n", (double)s->iterations_mean,
          m->solves.max);
  fprintf(f, "  \"memory_mb\": %.6g,\n", (double)s->memory_mb);
  print_balance(f, m);
  print_bandwidth(f, m);
  print_remarks(f);
  print_limits(f, m);
  print_quantities(f, m);
  fprintf(f, "}\n");
  return FileEnd(path, &f);
}
