/* Advice by meaning, not by spelling: see OptAdviseName in optimpl.h and OptAdviseWord in opt.h.

   A row says what others call its option (OptSpec.also) and its choices (OptSpec.words). A name without a section
   ("-dt"), or with one of another program ("-fluid_density"), is tried with all sections that the tables have. */
#include "compat.h"
#include "optimpl.h"
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#define SECTIONS 32
#define OFFERS   3 /* names that one message offers at most */

/* ---- choices ---- */

PetscBool OptNextPair(const char **at, char other[64], char word[64])
{
  int n = 0;

  if (!*at || sscanf(*at, " %63[^ ] %63[^,]%n", other, word, &n) != 2) return PETSC_FALSE;
  *at += n + ((*at)[n] == ',');
  return PETSC_TRUE;
}

void OptAdviseWord(const char word[], const char choices[], const char words[], char advice[], size_t len)
{
  const char *cursor = choices, *pairs = words;
  char        item[64], other[64], nearest[64] = "";
  PetscInt    best = PETSC_MAX_INT;

  advice[0] = 0;
  while (OptNextPair(&pairs, other, item))
    if (OptSameName(other, word)) {
      snprintf(advice, len, "; did you mean %s?", item);
      return;
    }
  while (OptNextItem(&cursor, item, sizeof(item))) {
    const PetscInt d = OptEditDistance(word, item);

    if (d >= best) continue;
    best = d;
    snprintf(nearest, sizeof(nearest), "%s", item);
  }
  if (best <= 2 && best < (PetscInt)strlen(nearest) - 1) snprintf(advice, len, "; did you mean %s?", nearest);
}

/* ---- names ---- */

/* "-particle_<group>_density" and "rho" make "-particle_<group>_rho" */
static void replace_end(const char pattern[], const char end[], char out[], size_t len)
{
  const char  *close = strrchr(pattern, '>'), *cut = strchr(close ? close : pattern, '_');
  const size_t n = cut ? (size_t)(cut - pattern) + 1 : 1;

  snprintf(out, len, "%.*s%.100s", (int)PetscMin(n, 200), pattern, end);
}

/* The option meant by `name`, if it is one, or what others call one: -flow_nu, -particle_disc_rho. */
static PetscBool find_meant(const char name[], char meant[], size_t len)
{
  const OptEntry *entry = OptFindEntry(name);
  const OptSpec  *exact = OptFindSpec(name);
  char            pattern[OPT_LINE], word[OPT_LINE], end[128];

  snprintf(meant, len, "%s", name);
  if (exact && (!strchr(exact->name, '<') || (entry && entry->is_read))) return PETSC_TRUE;
  for (size_t t = 0; t < opt_ntable; t++) {
    for (size_t i = 0; i < opt_table[t].n; i++) {
      const OptSpec *row    = opt_table[t].spec + i;
      const char    *cursor = row->also, *open = strchr(row->name, '<');

      while (OptNextItem(&cursor, end, sizeof(end))) {
        replace_end(row->name, end, pattern, sizeof(pattern));
        if (!OptFits(pattern, name, word, sizeof(word))) continue;
        if (open)
          snprintf(meant, len, "%.*s%.200s%.100s", (int)(open - row->name), row->name, word, strchr(open, '>') + 1);
        else snprintf(meant, len, "%s", row->name);
        if (!open || OptFindEntry(meant)) return PETSC_TRUE;
      }
    }
  }
  return PETSC_FALSE;
}

/* The first words of all rows: "-flow", ... */
static PetscInt list_sections(char section[SECTIONS][32])
{
  PetscInt n = 0;

  for (size_t t = 0; t < opt_ntable; t++) {
    for (size_t i = 0; i < opt_table[t].n; i++) {
      const char *name = opt_table[t].spec[i].name, *cut = strchr(name, '_');
      char        first[32];
      PetscInt    k = 0;

      if (!cut || cut - name > 30) continue;
      snprintf(first, sizeof(first), "%.*s", (int)(cut - name), name);
      while (k < n && strcmp(section[k], first)) k++;
      if (k == n && n < SECTIONS) strcpy(section[n++], first);
    }
  }
  return n;
}

void OptAdviseName(const char name[], char advice[], size_t len)
{
  char           section[SECTIONS][32], candidate[OPT_LINE + 64], meant[OFFERS][OPT_LINE];
  const char    *tail   = strchr(name, '_');
  PetscInt       nfound = 0;
  const PetscInt nsec   = list_sections(section);

  advice[0] = 0;
  if (find_meant(name, meant[0], sizeof(meant[0]))) nfound = 1;
  /* without a section, or with another one */
  for (PetscInt pass = 0; pass < 2 && !nfound; pass++) {
    for (PetscInt k = 0; k < nsec && nfound < OFFERS; k++) {
      if (pass && !tail) continue;
      snprintf(candidate, sizeof(candidate), "%.31s_%.500s", section[k], pass ? tail + 1 : name + 1);
      if (!find_meant(candidate, meant[nfound], sizeof(meant[0]))) continue;
      nfound++;
    }
  }
  if (nfound == 1) {
    const OptSpec *spec = OptFindSpec(meant[0]);
    char           meaning[OPT_LINE];

    OptFormatMeaning(spec, meaning, sizeof(meaning));
    snprintf(advice, len, "did you mean %s? %s", meant[0], meaning);
  }
  for (PetscInt k = 0; k < nfound && nfound > 1; k++) {
    const size_t used = strlen(advice);

    snprintf(advice + used, len - used, "%s%s%s",
             k == 0           ? "did you mean "
             : k < nfound - 1 ? ", "
                              : " or ",
             meant[k], k == nfound - 1 ? "?" : "");
  }
}
