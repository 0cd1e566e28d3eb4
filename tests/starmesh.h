/* A mesh file in which many cells meet at a node: n kites around the axis, in two layers. The node in the middle of the
   axis has 2n hexahedra, and 6n + 3 vertices in them. */
#pragma once
#include <math.h>
#include <stdio.h>

/* Volume of star_write's mesh: corners at radius 1, the outermost ones where the tangents there meet, layers of 1 */
static inline double star_volume(int n)
{
  const double pi = acos(-1.0);

  return 2 * n * tan(pi / n);
}

/* Write it, n >= 3, in Gmsh's format 2.2, without groups: its faces are one boundary. On one rank. 0: done */
static inline int star_write(const char path[], int n)
{
  const double half  = acos(-1.0) / n;
  const int    plane = 2 * n + 1; /* nodes of a plane: the axis, then at angles of k half */
  FILE        *f     = fopen(path, "w");

  if (!f) return 1;
  fprintf(f, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n%d\n", 3 * plane);
  for (int z = 0; z < 3; z++)
    for (int k = -1; k < 2 * n; k++) {
      const double r = k < 0 ? 0 : k % 2 ? 1 / cos(half) : 1;

      fprintf(f, "%d %.17g %.17g %d\n", z * plane + k + 2, r * cos(k * half), r * sin(k * half), z);
    }
  fprintf(f, "$EndNodes\n$Elements\n%d\n", 2 * n);
  for (int c = 0; c < 2 * n; c++) {
    const int i = c % n, corner[4] = {1, 2 + 2 * i, 3 + 2 * i, 2 + (2 * i + 2) % (2 * n)};

    fprintf(f, "%d 5 2 0 1", c + 1);
    for (int v = 0; v < 8; v++) fprintf(f, " %d", (c / n + v / 4) * plane + corner[v % 4]);
    fprintf(f, "\n");
  }
  fprintf(f, "$EndElements\n");
  return fclose(f);
}
