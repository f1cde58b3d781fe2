/* Places in the factor of a regression.
 *
 * The unit triangle U = D^(-1/2) R with z beside it is kept in tiles of 4 x 4, by rows, row of tiles after row of
 * tiles, from the diagonal tile to the right: a sweep over 4 rows runs through memory once, and a compiler makes
 * vectors of a tile's rows without knowing how long they are. Columns behind the target are 0 for ever.
 * Each tile is followed by its carry: the rounding errors of its entries, to be added back with the next row. Without
 * it an entry drifts at random, by half a unit in its last place a row. */
#ifndef HSEP_TILES_H
#define HSEP_TILES_H

#include "hsep_real.h"

#define HSEP_TILE 4
#define HSEP_TILE_ENTRIES 16 /* of a tile */
#define HSEP_TILE_STRIDE 32  /* numbers from tile to tile: the entries, then their carries */

/* Place of entry (i, j), i <= j, of [U z] in tiles for 4 n_tiles columns. */
static inline hsep_int hsep_tile_place(hsep_int n_tiles, hsep_int i, hsep_int j)
{
    const hsep_int row = i / HSEP_TILE, column = j / HSEP_TILE;
    const hsep_int tile = row * n_tiles - row * (row + 1) / 2 + column; /* fewer by one in each row of them */
    return HSEP_TILE_STRIDE * tile + 4 * (i % HSEP_TILE) + j % HSEP_TILE;
}

#endif
