"""What every other part uses: errors, clock, files, mailboxes, histograms."""
