/* Scores frames by int16 tables in int16 accumulators, as the smallest board does, and aborts where a sum does not fit.
 *
 * stdin, all int16 or uint16 of this machine: K, s, j, the number of frames; of each joint its number of thresholds;
 * bias; switch rows; switch means; joint means; thresholds; joint rows. Then frames: s bits, s lost, j codes, j lost.
 * stdout, a frame: K scores and the number of the first best, int16 each.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

static void read_words(void *to, size_t n)
{
    if (fread(to, 2, n, stdin) != n) {
        abort();
    }
}

static int16_t *words(size_t n)
{
    int16_t *block = calloc(n + 1, 2);
    if (block == NULL) {
        abort();
    }
    read_words(block, n);
    return block;
}

static void add(int16_t *scores, const int16_t *row, uint16_t n_classes)
{
    for (uint16_t k = 0; k < n_classes; k++) {
        int wide = scores[k] + row[k];
        scores[k] = (int16_t)wide;
        if (scores[k] != wide) {
            abort();
        }
    }
}

static uint16_t first_best(const int16_t *scores, uint16_t n_classes)
{
    uint16_t best = 0;
    for (uint16_t k = 1; k < n_classes; k++) {
        if (scores[k] > scores[best]) {
            best = k;
        }
    }
    return best;
}

int main(void)
{
    uint16_t head[4];
    read_words(head, 4);
    const uint16_t K = head[0], s = head[1], j = head[2];
    uint16_t *counts = (uint16_t *)words(j);
    int16_t *bias = words(K), *switches = words((size_t)s * K), *means = words((size_t)s * K);
    int16_t *joint_means = words((size_t)j * K);
    uint16_t **thresholds = calloc((size_t)j + 1, sizeof *thresholds);
    int16_t **rows = calloc((size_t)j + 1, sizeof *rows);
    int16_t *scores = calloc(K, 2);
    if (thresholds == NULL || rows == NULL || scores == NULL) {
        abort();
    }
    for (uint16_t a = 0; a < j; a++) {
        thresholds[a] = (uint16_t *)words(counts[a]);
    }
    for (uint16_t a = 0; a < j; a++) {
        rows[a] = words(((size_t)counts[a] + 1) * K);
    }
    for (uint16_t frame = 0; frame < head[3]; frame++) {
        int16_t *bits = words(s), *lost = words(s);
        uint16_t *codes = (uint16_t *)words(j);
        int16_t *silent = words(j);
        for (uint16_t k = 0; k < K; k++) {
            scores[k] = bias[k];
        }
        for (uint16_t i = 0; i < s; i++) {
            if (lost[i]) {
                add(scores, means + (size_t)i * K, K);
            } else if (bits[i]) {
                add(scores, switches + (size_t)i * K, K);
            }
        }
        for (uint16_t a = 0; a < j; a++) {
            uint16_t bin = 0;
            while (bin < counts[a] && thresholds[a][bin] < codes[a]) {
                bin++;
            }
            add(scores, silent[a] ? joint_means + (size_t)a * K : rows[a] + (size_t)bin * K, K);
        }
        const uint16_t best = first_best(scores, K);
        if (fwrite(scores, 2, K, stdout) != K || fwrite(&best, 2, 1, stdout) != 1) {
            abort();
        }
        free(bits);
        free(lost);
        free(codes);
        free(silent);
    }
    return 0;
}
