/* The tables of options in print: -help, runs/reference/OPTIONS.md, manual page. See OptPrint in opt.h. */
#include "compat.h"
#include "optimpl.h"
#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

/* ---- tables ---- */

static void print_line(FILE *file, const OptSpec *spec)
{
  char meaning[OPT_LINE];

  OptFormatMeaning(spec, meaning, sizeof(meaning));
  fprintf(file, "%s", spec->name);
  if (spec->value && spec->value[0]) fprintf(file, " <%s>", spec->value);
  fprintf(file, ": %s%s%s\n", meaning, spec->when ? "; with " : "", spec->when ? spec->when : "");
}

/* Does one of its words begin with this one, or if that is short, is it one? Upper case counts as lower case. */
static PetscBool contains(const char text[], const char word[])
{
  const size_t n = strlen(word);

  for (const char *at = text; at && *at; at++) {
    if (at > text && isalnum(at[-1])) continue;
    if (!strncasecmp(at, word, n) && (n > 3 || !isalnum(at[n]))) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* shape: what reads a parameter of a shape is found by the name of that ("ellipse") */
static PetscBool matches_word(const OptSpec *spec, const char word[])
{
  const char       *shape          = spec->when ? strstr(spec->when, "_shape ") : NULL;
  const char *const text[]         = {spec->name + 1, spec->help, spec->also, spec->choices,
                                      spec->words,    spec->old,  spec->find, shape};
  char              name[OPT_NAME] = "-";

  word += word[0] == '-';
  snprintf(name, sizeof(name), "-%s", word);
  if (OptFits(spec->name, name, NULL, 0)) return PETSC_TRUE;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(text); i++) {
    if (contains(text[i], word)) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* All words, with blanks between them */
static PetscBool matches(const OptSpec *spec, const char words[])
{
  char word[OPT_NAME];

  for (int n = 0; sscanf(words, "%127s%n", word, &n) == 1; words += n)
    if (!matches_word(spec, word)) return PETSC_FALSE;
  return PETSC_TRUE;
}

int OptPrintMatching(FILE *file, const char word[])
{
  const OptSpec *spec;
  OptCursor      at    = {0};
  const char    *title = NULL;
  int            n     = 0;

  for (; (spec = OptNextSpec(&at));) {
    if (at.title) title = at.title;
    if (!matches(spec, word)) continue;
    if (title) fprintf(file, "%s%s\n", n ? "\n" : "", title);
    title = NULL;
    print_line(file, spec);
    n++;
  }
  return n;
}

static void print_plain(FILE *file, PetscBool expert)
{
  const OptSpec *spec;
  OptCursor      at     = {0};
  const char    *title  = NULL;
  int            hidden = 0;

  while ((spec = OptNextSpec(&at))) {
    if (at.title) title = at.title;
    if (spec->expert && !expert) {
      hidden++;
      continue;
    }
    if (title) fprintf(file, "\n%s\n", title);
    title = NULL;
    print_line(file, spec);
  }
  if (hidden) fprintf(file, "\n%d more, for experts: -help expert\n", hidden);
}

/* Text in a cell of a table: '|' would end it, and <group> is no HTML */
static void print_cell(FILE *file, const char text[])
{
  fprintf(file, "|%s", text && text[0] ? " " : "");
  for (; text && *text; text++) fprintf(file, strchr("|<*_", *text) ? "\\%c" : "%c", *text);
  fprintf(file, " ");
}

/* What others call it, and the keywords that are not among that */
static void join_keywords(const OptSpec *spec, char text[OPT_LINE])
{
  char word[OPT_NAME];

  snprintf(text, OPT_LINE, "%s", spec->also ? spec->also : "");
  for (const char *at = spec->find; at && sscanf(at, " %127[^,]", word) == 1;
       at             = strchr(at, ',') ? strchr(at, ',') + 1 : NULL) {
    const size_t n = strlen(text);

    if (!contains(text, word)) snprintf(text + n, OPT_LINE - n, "%s%s", n ? ", " : "", word);
  }
}

static void print_markdown(FILE *file)
{
  const OptSpec *spec;
  OptCursor      at      = {0};
  const char    *padding = "";
  char           range[OPT_LINE], keywords[OPT_LINE];

  fprintf(file,
          "# Options\n\nMade by `make options` from the tables in `src/<room>/options.c`; `-help expert` prints the same. A key of a scene "
          "file is the name without its dash, nested at any `_`; a path in a scene is relative to the scene file. "
          "`-help WORD` looks for a word in names, meanings and keywords. The room is the folder of `src/` that reads the option.\n");
  while ((spec = OptNextSpec(&at))) {
    if (at.title)
      fprintf(file,
              "\n## %s\n\n| option | room | unit | range | default | meaning | read with | keywords |\n"
              "| --- | --- | --- | --- | --- | --- | --- | --- |\n",
              padding = at.title);
    OptFormatRange(spec, range, sizeof(range));
    if (spec->variables) snprintf(range, sizeof(range), "or expressions of %s", spec->variables);
    join_keywords(spec, keywords);
    fprintf(file, "| `%s` | %.*s ", spec->name, (int)strcspn(padding, ":"), padding);
    print_cell(file, spec->unit);
    print_cell(file, spec->choices ? spec->choices : range);
    print_cell(file, spec->value);
    print_cell(file, spec->help);
    print_cell(file, spec->when);
    print_cell(file, keywords);
    fprintf(file, "|\n");
  }
}

/* Text for roff: a dash is a minus, a backslash and a quote at the start of a line are commands */
static void print_roff(FILE *file, const char text[])
{
  for (; *text; text++) fprintf(file, *text == '-' ? "\\-" : *text == '\\' ? "\\e" : "%c", *text);
}

static void print_man(FILE *file)
{
  const OptSpec *spec;
  OptCursor      at = {0};
  char           meaning[OPT_LINE];

  fprintf(file,
          ".TH TUMBLE 1\n.SH NAME\ntumble \\- rigid bodies of any shape in a viscous incompressible fluid\n.SH SYNOPSIS\n"
          ".B mpiexec \\-n\n.I N\n.B tumble\n.I scene.yaml\n[\\fB\\-option\\fR \\fIvalue\\fR ...]\n.SH DESCRIPTION\n"
          "Nested keys of the scene file are joined by _ into one option; the command line wins over the file.\n"
          "Options of PETSc's solvers have the prefixes \\-flow_, \\-flow_fieldsplit_velocity_, \\-flow_fieldsplit_pressure_;\n"
          "\\fB\\-help petsc\\fR lists those of a scene. \\fB\\-help\\fR lists what follows, \\fB\\-version\\fR the versions.\n");
  while ((spec = OptNextSpec(&at))) {
    if (at.title) fprintf(file, ".SH OPTIONS: %s\n", at.title);
    fprintf(file, ".TP\n.B ");
    print_roff(file, spec->name);
    if (spec->value && spec->value[0]) fprintf(file, " <");
    if (spec->value && spec->value[0]) print_roff(file, spec->value);
    fprintf(file, "%s\n", spec->value && spec->value[0] ? ">" : "");
    OptFormatMeaning(spec, meaning, sizeof(meaning));
    print_roff(file, meaning);
    if (spec->when) fprintf(file, ". Read with ");
    if (spec->when) print_roff(file, spec->when);
    fprintf(file, "\n");
  }
}

void OptPrint(FILE *file, OptFormat format)
{
  if (format == OPT_MARKDOWN) print_markdown(file);
  else if (format == OPT_MAN) print_man(file);
  else if (format == OPT_SCHEMA) OptPrintSchema(file);
  else print_plain(file, (PetscBool)(format == OPT_PLAIN_EXPERT));
}
