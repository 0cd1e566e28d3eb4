/* What the summary of a run consists of beside the Monitor, for the page (summary.c) and for summary.json
   (summaryjson.c). */
#pragma once
#include "impl.h"
#include "versions.h"

typedef struct {
  const char *scene;
  PetscInt    cells, unknowns, steps;
  PetscReal   time_end, seconds[MONITOR_NPHASES], total, memory_mb, iterations_mean;
  Versions    versions;
} Summary;

extern const char *const SUMMARY_PHASE[];
/* Is a phase worth a line? That of remeshing not where there was none. */
static inline PetscBool SummaryShowsPhase(const Summary *s, PetscInt phase)
{
  return (PetscBool)(phase != MONITOR_MESH || s->seconds[phase] > 0);
}

/* Rank 0: summary.json. 0 or errno. */
int SummaryWrite(Monitor, const Summary *, const char path[]);
